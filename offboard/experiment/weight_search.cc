#include "offboard/experiment/weight_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <mutex>
#include <thread>

#include "offboard/experiment/cma_es.h"

namespace vantage {
namespace {

constexpr double kSigma = 0.6;     // of the first step, log10
constexpr double kOutside = 0.01;  // coverage lost for each squared unit below the least coordinate

/// Mean area of the scenes, several at a time. Nothing when stopped.
std::optional<double> mean_area(const std::vector<TuningScene*>& scenes, const CombinedWeights& weights, int threads,
                                const std::atomic<bool>& stop) {
  std::vector<double> areas(scenes.size());
  std::atomic<std::size_t> next = 0, done = 0;
  std::mutex mutex;  // guards failure
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < scenes.size() && !stop; i = next++) {
        areas[i] = scenes[i]->area(weights);
        ++done;
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
      next = scenes.size();
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  for (std::thread& thread : others) thread.join();
  if (failure) std::rethrow_exception(failure);
  if (done < scenes.size()) return std::nullopt;
  double mean = 0;
  for (const double area : areas) mean += area / static_cast<double>(areas.size());
  return mean;
}

}  // namespace

WeightCoordinates::WeightCoordinates(const std::vector<TuningScene*>& scenes) {
  std::array<double, kFormulations> mean{};
  for (TuningScene* scene : scenes) {
    const std::array<double, kFormulations> gains = scene->first_gains();
    for (std::size_t f = 0; f < kFormulations; ++f) mean[f] += gains[f] / static_cast<double>(scenes.size());
  }
  for (const Formulation f : kAllFormulations) {
    const double gain = mean[static_cast<std::size_t>(f)];
    if (f == Formulation::kCombined || !(gain > 0)) continue;
    formulations_.push_back(f);
    mean_gain_.push_back(gain);
  }
}

CombinedWeights WeightCoordinates::weights_of(const Eigen::VectorXd& x) const {
  const double largest = x.maxCoeff();
  CombinedWeights weights;
  weights.weight.fill(0);
  for (std::size_t i = 0; i < formulations_.size(); ++i) {
    const double share = std::max(kLeast, x[static_cast<Eigen::Index>(i)] - largest);
    weights[formulations_[i]] = std::pow(10, share) / mean_gain_[i];
  }
  return weights;
}

Eigen::VectorXd WeightCoordinates::of_weights(const CombinedWeights& weights) const {
  Eigen::VectorXd x(static_cast<Eigen::Index>(formulations_.size()));
  for (std::size_t i = 0; i < formulations_.size(); ++i) {
    x[static_cast<Eigen::Index>(i)] = std::log10(std::max(weights[formulations_[i]] * mean_gain_[i], 1e-300));
  }
  return (x.array() - x.maxCoeff()).cwiseMax(kLeast);
}

std::optional<FoundWeights> search_weights(const std::string& name, const std::vector<TuningScene*>& scenes,
                                           const WeightCoordinates& coordinates, const Eigen::VectorXd& start,
                                           const WeightSearchOptions& options, EvaluationLog* log,
                                           const std::atomic<bool>& stop,
                                           const std::function<void(const FoundWeights&)>& tell) {
  FoundWeights found;
  std::size_t index = 0;
  const auto value_of = [&](const Eigen::VectorXd& x) -> std::optional<double> {
    const std::optional<double> known = log->find(name, index);
    const std::optional<double> value =
        known ? known : mean_area(scenes, coordinates.weights_of(x), options.threads, stop);
    if (!value) return std::nullopt;
    if (index == 0) found.value_of_start = *value;
    if (index == 0 || *value > found.value) {
      found.x = x;
      found.value = *value;
    }
    if (!known) {
      log->add(name, index, *value);
      tell(found);
    }
    ++index;
    return value;
  };
  if (!value_of(start)) return std::nullopt;
  CmaEs search(start, {.sigma = kSigma, .seed = options.seed});
  while (index + search.ask().size() <= static_cast<std::size_t>(options.evaluations)) {
    std::vector<double> losses;
    for (const Eigen::VectorXd& x : search.ask()) {
      const std::optional<double> value = value_of(x);
      if (!value) return std::nullopt;
      const double below = (x.array() - x.maxCoeff() - WeightCoordinates::kLeast).cwiseMin(0).matrix().squaredNorm();
      losses.push_back(kOutside * below - *value);
    }
    search.tell(losses);
  }
  return found;
}

}  // namespace vantage
