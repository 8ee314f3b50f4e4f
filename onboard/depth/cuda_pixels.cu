#include <cuda_runtime.h>

#include "onboard/depth/cuda_pixels.h"

namespace vantage {
namespace {

constexpr int kBlockWidth = 32, kBlockHeight = 4;
constexpr int kStripRows = kPatchRows + 2 * kMaxAcross;

struct DeviceLevel {
  const std::uint8_t* pixels;
  int width, height, stride;
};

struct Job {
  PairGeometry geometry;
  PixelSettings settings;
  DeviceLevel key[CudaPixels::kLevels], frame[CudaPixels::kLevels];
  PixelBelief* beliefs;
  PixelState* states;
  CudaCounts* counts;
  std::uint32_t turns, turn;
};

/// Grey at (x, y), bilinear; coordinates are pulled inside the image. As the CPU's, operation by operation.
__device__ float sample(const DeviceLevel& image, float x, float y) {
  x = fminf(fmaxf(x, 0.0F), static_cast<float>(image.width) - 1.001F);
  y = fminf(fmaxf(y, 0.0F), static_cast<float>(image.height) - 1.001F);
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
  const std::uint8_t* p = image.pixels + static_cast<std::ptrdiff_t>(row) * image.stride + column;
  const float p00 = __ldg(p), p10 = __ldg(p + 1), p01 = __ldg(p + image.stride), p11 = __ldg(p + image.stride + 1);
  const float top = fmaf(fx, p10 - p00, p00), bottom = fmaf(fx, p11 - p01, p01);
  return fmaf(fy, bottom - top, top);
}

/// The key frame's patch, zero-mean and of unit norm, as it would look in the frame. False when it has less gradient
/// along the line than its match needs.
__device__ bool take_template(const Job& job, const Search& search, float x, float y,
                              float (&patch)[kPatchRows][kPatchColumns], float* mean) {
  const EpipolarLine& line = search.line;
  const DeviceLevel& image = job.key[search.level];
  const float cx = (x + 0.5F) / search.scale - 0.5F, cy = (y + 0.5F) / search.scale - 0.5F;
  const float* m = line.to_key;
  const float ax = m[0] * line.ex + m[1] * line.ey, ay = m[2] * line.ex + m[3] * line.ey;
  const float bx = -m[0] * line.ey + m[1] * line.ex, by = -m[2] * line.ey + m[3] * line.ex;
  float sum = 0;
  for (int j = 0; j < kPatchRows; ++j) {
    for (int i = 0; i < kPatchColumns; ++i) {
      const float along = kStep * static_cast<float>(i - kPatchColumns / 2),
                  across = static_cast<float>(j - kPatchRows / 2);
      patch[j][i] = sample(image, fmaf(ax, along, fmaf(bx, across, cx)), fmaf(ay, along, fmaf(by, across, cy)));
      sum += patch[j][i];
    }
  }
  *mean = sum / kPatchSamples;
  float gradient = 0, squares = 0;
  for (int j = 0; j < kPatchRows; ++j) {
    for (int i = 1; i + 1 < kPatchColumns; ++i) {
      const float slope = patch[j][i + 1] - patch[j][i - 1];
      gradient += slope * slope;
    }
  }
  const float least = job.settings.image_noise / job.settings.max_texture_sigma_px;
  if (gradient < 2 * least * least * 4 * kStep * kStep) return false;
  for (auto& row : patch) {
    for (float& grey : row) {
      grey -= *mean;
      squares += grey * grey;
    }
  }
  const float norm = 1 / sqrtf(squares);
  for (auto& row : patch) {
    for (float& grey : row) grey *= norm;
  }
  return true;
}

/// Where the strip's samples lie, in pixels of the level.
struct StripPlace {
  float u, v, ex, ey;
  __device__ StripPlace(const Search& search)
      : u((search.line.u0 + search.first * search.line.ex + 0.5F) / search.scale - 0.5F),
        v((search.line.v0 + search.first * search.line.ey + 0.5F) / search.scale - 0.5F),
        ex(search.line.ex),
        ey(search.line.ey) {}
  /// Column `i` counts from kPatchColumns / 2 steps before the first place; row `j` of the strip.
  __device__ float grey(const DeviceLevel& image, int i, int j, int across_lines, float mean) const {
    const float along = kStep * static_cast<float>(i - kPatchColumns / 2);
    const float across = static_cast<float>(j - kPatchRows / 2 - across_lines);
    return sample(image, fmaf(along, ex, u - across * ey), fmaf(along, ey, v + across * ex)) - mean;
  }
};

/// Correlations of every place and line. The strip passes through a window of one patch's columns.
__device__ void correlate(const Job& job, const Search& search, const float (&patch)[kPatchRows][kPatchColumns],
                          float mean, float (&scores)[(2 * kMaxAcross + 1) * kMaxSteps]) {
  const DeviceLevel& image = job.frame[search.level];
  const StripPlace place(search);
  const int rows = kPatchRows + 2 * search.across;
  float window[kPatchColumns][kStripRows];
  for (int i = 0; i + 1 < kPatchColumns; ++i) {
    for (int j = 0; j < rows; ++j) window[i + 1][j] = place.grey(image, i, j, search.across, mean);
  }
  for (int step = 0; step < search.steps; ++step) {
    for (int i = 0; i + 1 < kPatchColumns; ++i) {
      for (int j = 0; j < rows; ++j) window[i][j] = window[i + 1][j];
    }
    for (int j = 0; j < rows; ++j) {
      window[kPatchColumns - 1][j] = place.grey(image, step + kPatchColumns - 1, j, search.across, mean);
    }
    for (int o = 0; o <= 2 * search.across; ++o) {
      float product = 0, sum = 0, squares = 0;
      for (int j = 0; j < kPatchRows; ++j) {
        for (int i = 0; i < kPatchColumns; ++i) {
          const float grey = window[i][o + j];
          product = fmaf(patch[j][i], grey, product);
          sum += grey;
          squares = fmaf(grey, grey, squares);
        }
      }
      const float spread = fmaxf(squares - sum * sum / kPatchSamples, 1.0F);
      scores[o * kMaxSteps + step] = product / sqrtf(spread);
    }
  }
}

__device__ MatchSums match_sums(const Job& job, const Search& search, const float (&a)[kPatchRows][kPatchColumns],
                                float mean, const Match& match) {
  constexpr float kInner = kPatchRows * (kPatchColumns - 2);
  const StripPlace place(search);
  float b[kPatchRows][kPatchColumns];
  float sum_a = 0, sum_b = 0;
  for (int j = 0; j < kPatchRows; ++j) {
    for (int i = 0; i < kPatchColumns; ++i) {
      b[j][i] = place.grey(job.frame[search.level], match.step + i, match.line + j, search.across, mean);
      if (i > 0 && i + 1 < kPatchColumns) {
        sum_a += a[j][i];
        sum_b += b[j][i];
      }
    }
  }
  const float mean_a = sum_a / kInner, mean_b = sum_b / kInner;
  float aa = 0, bb = 0;
  for (int j = 0; j < kPatchRows; ++j) {
    for (int i = 1; i + 1 < kPatchColumns; ++i) {
      aa += (a[j][i] - mean_a) * (a[j][i] - mean_a);
      bb += (b[j][i] - mean_b) * (b[j][i] - mean_b);
    }
  }
  const float scale_a = 1 / sqrtf(aa), scale_b = 1 / sqrtf(bb);
  MatchSums sums;
  for (int j = 0; j < kPatchRows; ++j) {
    for (int i = 1; i + 1 < kPatchColumns; ++i) {
      const float e = scale_a * (a[j][i] - mean_a) - scale_b * (b[j][i] - mean_b);
      const float g = 0.25F * (scale_a * (a[j][i + 1] - a[j][i - 1]) + scale_b * (b[j][i + 1] - b[j][i - 1]));
      sums.gg += g * g;
      sums.ge += g * e;
      sums.ee += e * e;
      sums.g += g;
    }
  }
  return sums;
}

/// One pixel, one thread.
__device__ void update_pixel(const Job& job, int x, int y, CudaCounts* counts) {
  const int index = y * job.settings.width + x;
  PixelState& state = job.states[index];
  if (state == PixelState::kBorder || state == PixelState::kNoTexture || state == PixelState::kDiverged) return;
  PixelBelief belief = job.beliefs[index];
  if (state == PixelState::kConverged && settled(belief, job.settings)) return;
  if ((static_cast<std::uint32_t>(x) + 2U * static_cast<std::uint32_t>(y)) % job.turns != job.turn) return;
  atomicAdd(&counts->planned, 1);
  const Search search = plan_search(job.geometry, job.settings, belief, static_cast<float>(x), static_cast<float>(y));
  PixelState outcome = PixelState::kUpdating;
  float patch[kPatchRows][kPatchColumns], mean = 0;
  if (search.kind == Search::Kind::kNotVisible) {
    outcome = PixelState::kNotVisible;
    atomicAdd(&counts->not_visible, 1);
  } else if (search.kind == Search::Kind::kSearch &&
             take_template(job, search, static_cast<float>(x), static_cast<float>(y), patch, &mean)) {
    float scores[(2 * kMaxAcross + 1) * kMaxSteps];
    correlate(job, search, patch, mean, scores);
    Match match = best_match(search, job.settings, scores, kMaxSteps);
    if (match.kind == Match::Kind::kFound) finish_match(search, match_sums(job, search, patch, mean, match), &match);
    atomicAdd(&counts->searched, 1);
    atomicAdd(&counts->samples, static_cast<unsigned long long>(search.steps + kPatchColumns - 1) *
                                    static_cast<unsigned long long>(kPatchRows + 2 * search.across));
    if (match.kind == Match::Kind::kFound) {
      belief = belief_after(belief, search, match, job.settings);
      atomicAdd(&counts->matched, 1);
    } else if (match.kind == Match::Kind::kNone) {
      if (!search.cut) belief = missed_belief(belief);
      outcome = search.cut ? PixelState::kNotVisible : PixelState::kNoMatch;
    } else {
      atomicAdd(&counts->ambiguous, 1);
    }
  }
  job.beliefs[index] = belief;
  state = state_of(belief, job.settings, outcome);
}

/// Counts are summed a block first.
__global__ void update_kernel(Job job) {
  __shared__ CudaCounts counts;
  const int thread = static_cast<int>(threadIdx.y * blockDim.x + threadIdx.x);
  if (thread == 0) counts = CudaCounts();
  __syncthreads();
  const int x = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x < job.settings.width && y < job.settings.height) {
    update_pixel(job, x, y, &counts);
    atomicAdd(&counts.states[static_cast<int>(job.states[y * job.settings.width + x])], 1);
  }
  __syncthreads();
  if (thread != 0) return;
  for (int s = 0; s < kPixelStates; ++s) atomicAdd(&job.counts->states[s], counts.states[s]);
  atomicAdd(&job.counts->planned, counts.planned);
  atomicAdd(&job.counts->not_visible, counts.not_visible);
  atomicAdd(&job.counts->searched, counts.searched);
  atomicAdd(&job.counts->matched, counts.matched);
  atomicAdd(&job.counts->ambiguous, counts.ambiguous);
  atomicAdd(&job.counts->samples, counts.samples);
}

const char* said(cudaError_t error) { return error == cudaSuccess ? nullptr : cudaGetErrorString(error); }

}  // namespace

struct CudaPixels::Device {
  Job job{};
  std::uint8_t* images[2][kLevels] = {};  ///< of key frame and frame
  std::size_t pixels = 0;
};

bool CudaPixels::available() {
  int devices = 0;
  return cudaGetDeviceCount(&devices) == cudaSuccess && devices > 0;
}

CudaPixels::~CudaPixels() {
  if (device_ == nullptr) return;
  cudaFree(device_->job.beliefs);
  cudaFree(device_->job.states);
  cudaFree(device_->job.counts);
  for (auto& pyramid : device_->images) {
    for (std::uint8_t* level : pyramid) cudaFree(level);
  }
  delete device_;
}

const char* CudaPixels::create(const PixelSettings& settings) {
  device_ = new Device;
  Device& d = *device_;
  d.job.settings = settings;
  d.pixels = static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height);
  cudaError_t error = cudaMalloc(&d.job.beliefs, d.pixels * sizeof(PixelBelief));
  if (error == cudaSuccess) error = cudaMalloc(&d.job.states, d.pixels * sizeof(PixelState));
  if (error == cudaSuccess) error = cudaMalloc(&d.job.counts, sizeof(CudaCounts));
  for (int image = 0; image < 2; ++image) {
    for (int l = 0; l < kLevels; ++l) {
      DeviceLevel& level = image == 0 ? d.job.key[l] : d.job.frame[l];
      level.width = settings.width >> l;
      level.height = settings.height >> l;
      level.stride = level.width;
      const std::size_t bytes = static_cast<std::size_t>(level.stride) * static_cast<std::size_t>(level.height);
      if (error == cudaSuccess) error = cudaMalloc(&d.images[image][l], bytes);
      level.pixels = d.images[image][l];
    }
  }
  return said(error);
}

const char* CudaPixels::start(const HostLevel (&key)[kLevels], const PixelBelief* beliefs, const PixelState* states) {
  Device& d = *device_;
  cudaError_t error = cudaMemcpy(d.job.beliefs, beliefs, d.pixels * sizeof(PixelBelief), cudaMemcpyHostToDevice);
  if (error == cudaSuccess) {
    error = cudaMemcpy(d.job.states, states, d.pixels * sizeof(PixelState), cudaMemcpyHostToDevice);
  }
  for (int l = 0; l < kLevels && error == cudaSuccess; ++l) {
    error = cudaMemcpy2D(d.images[0][l], static_cast<std::size_t>(d.job.key[l].stride), key[l].pixels,
                         static_cast<std::size_t>(key[l].stride), static_cast<std::size_t>(key[l].width),
                         static_cast<std::size_t>(key[l].height), cudaMemcpyHostToDevice);
  }
  return said(error);
}

const char* CudaPixels::update(const HostLevel (&frame)[kLevels], const PairGeometry& geometry, std::uint32_t turns,
                               std::uint32_t turn, CudaCounts* counts) {
  Device& d = *device_;
  cudaError_t error = cudaMemset(d.job.counts, 0, sizeof(CudaCounts));
  for (int l = 0; l < kLevels && error == cudaSuccess; ++l) {
    error = cudaMemcpy2D(d.images[1][l], static_cast<std::size_t>(d.job.frame[l].stride), frame[l].pixels,
                         static_cast<std::size_t>(frame[l].stride), static_cast<std::size_t>(frame[l].width),
                         static_cast<std::size_t>(frame[l].height), cudaMemcpyHostToDevice);
  }
  if (error != cudaSuccess) return said(error);
  d.job.geometry = geometry;
  d.job.turns = turns;
  d.job.turn = turn;
  const dim3 block(kBlockWidth, kBlockHeight);
  const dim3 grid((static_cast<unsigned>(d.job.settings.width) + block.x - 1) / block.x,
                  (static_cast<unsigned>(d.job.settings.height) + block.y - 1) / block.y);
  update_kernel<<<grid, block>>>(d.job);
  error = cudaGetLastError();
  if (error == cudaSuccess) error = cudaMemcpy(counts, d.job.counts, sizeof(CudaCounts), cudaMemcpyDeviceToHost);
  return said(error);
}

const char* CudaPixels::read(PixelBelief* beliefs, PixelState* states) const {
  const Device& d = *device_;
  cudaError_t error = cudaMemcpy(beliefs, d.job.beliefs, d.pixels * sizeof(PixelBelief), cudaMemcpyDeviceToHost);
  if (error == cudaSuccess) {
    error = cudaMemcpy(states, d.job.states, d.pixels * sizeof(PixelState), cudaMemcpyDeviceToHost);
  }
  return said(error);
}

}  // namespace vantage
