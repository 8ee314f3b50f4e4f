#include "offboard/lookahead/convolution_lanes.h"

void vantage::convolution_kernel::avx512(const Row& row) { convolve_row<16>(row); }
