#include "offboard/experiment/convolution_lanes.h"

void vantage::convolution_kernel::avx2(const Row& row) { convolve_row<8>(row); }
