#include "offboard/lookahead/convolution_lanes.h"

void vantage::convolution_kernel::portable(const Row& row) { convolve_row<4>(row); }
