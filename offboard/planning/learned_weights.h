#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "offboard/gain/formulation.h"
#include "offboard/planning/shape_descriptor.h"

namespace vantage {

/// Weights of the combined formulation (Eq. 10) that were learned offline, for the whole of a training set and for each
/// of its objects, with what the objects look like after one view.
///
///     const LearnedWeights learned = LearnedWeights::load("weights.txt");   // vantage-experiment tune wrote it
///     options.weights = learned.nearest(map);                               // after the first depth map
///
/// The file is text:
///
///     vantage-weights 1
///     # any comment
///     formulations entropy occlusion_aware …    order of the weights, `combined` left out
///     descriptor height aspect …                order of the descriptor's numbers
///     all W…                                    weights for the whole set
///     object NAME W…                            weights for one object,
///     seen NAME D…                              and its descriptors, one for each first view that was tried
class LearnedWeights {
 public:
  struct Object {
    std::string name;
    CombinedWeights weights;
    std::vector<ShapeDescriptor> seen;  ///< at least one
  };

  /// \throws std::invalid_argument for weights that are not valid or objects without a descriptor.
  LearnedWeights(const CombinedWeights& all, std::vector<Object> objects);

  /// \throws InputError "file:line: …" for what save does not write.
  static LearnedWeights load(const std::filesystem::path& path);
  /// Whole or not at all; load gives the same weights to the bit. Each line of `comment` is put behind a '#'.
  /// \throws InputError when it can't be written.
  void save(const std::filesystem::path& path, const std::string& comment) const;

  /// Weights for the whole set.
  const CombinedWeights& all() const { return all_; }
  const std::vector<Object>& objects() const { return objects_; }

  /// The object with the descriptor nearest to `shape`, each number measured by its standard deviation over all
  /// descriptors of the set; ties go to the first. Null without objects.
  const Object* nearest_object(const ShapeDescriptor& shape) const;
  /// Weights of the object nearest to what a map shows; those of the whole set without objects.
  const CombinedWeights& nearest(const OccupancyMap& map) const;

 private:
  CombinedWeights all_;
  std::vector<Object> objects_;
  ShapeDescriptor scale_;  // standard deviations; 0 where all are alike
};

}  // namespace vantage
