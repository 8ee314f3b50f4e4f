#pragma once

/// Marks the few functions that both the CPU's and CUDA's code run: the filter's arithmetic is written once.
#if defined(__CUDACC__)
#define VANTAGE_HOST_DEVICE __host__ __device__
#else
#define VANTAGE_HOST_DEVICE
#endif
