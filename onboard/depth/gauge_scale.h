#pragma once

#include <vector>

#include <Eigen/Geometry>

namespace vantage {

/// How long the unit of a key frame's gauge is in metres: least squares over all frames' given places, the key frame's
/// own error an unknown like the scale. Allocates at construction only.
class GaugeScale {
 public:
  GaugeScale() { stations_.reserve(kMostStations); }

  /// Of a new key frame. `carried_sigma`: of the unit where it was carried over as a metre; 0 where it was not.
  void begin(const Eigen::Matrix3d& key_shift_covariance, double carried_sigma);

  /// A frame's place in gauge units, as it was adjusted, and in metres, as it was given, of the stated information.
  /// From the thousandth on they are passed over.
  void add(const Eigen::Isometry3d& T_frame_key, const Eigen::Vector3d& given_m, const Eigen::Matrix3d& information);
  void forget_frames() { stations_.clear(); }

  /// Scale, its sigma and the key frame's error anew. `noise`: variance of the given places over the stated one.
  void follow(double noise);
  /// The sigma alone: the scale stays what it is.
  void follow_sigma(double noise);

  /// From now on a unit is a metre, whatever was believed of it, and the key frame's place right.
  void hold_metre();

  /// From now on a unit is what was believed to be a metre; returns the metres in the unit until now.
  double make_unit_a_metre();

  double scale() const { return scale_; }                          ///< metres in a unit
  double sigma() const { return sigma_; }                          ///< of it; infinite while nothing is known
  const Eigen::Vector3d& key_error() const { return key_error_; }  ///< of the key frame's place, metres, its own axes

 private:
  static constexpr std::size_t kMostStations = 1000;

  struct Station {
    Eigen::Matrix3d R;
    Eigen::Vector3d t, given;
    Eigen::Matrix3d information;
  };
  bool solve(double noise, Eigen::Vector4d* solution, double* sigma) const;

  std::vector<Station> stations_;
  Eigen::Matrix3d key_information_ = Eigen::Matrix3d::Zero();
  double carried_sigma_ = 0;
  double scale_ = 1, sigma_ = 0;
  Eigen::Vector3d key_error_ = Eigen::Vector3d::Zero();
};

}  // namespace vantage
