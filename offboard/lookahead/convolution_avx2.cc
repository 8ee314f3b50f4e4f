#include "offboard/lookahead/convolution_lanes.h"

void vantage::convolution_kernel::avx2(const Row& row) { convolve_row<8>(row); }
