#pragma once

#include <cstdint>
#include <string_view>

#include "calib/files/ply.h"

namespace vantage {

/// What a shape's number makes it: 1, 7, 13, … are superquadrics, 2, 8, 14, … the next kind, and so on; from
/// kFirstTurnedShape on the kinds follow each other by nines, and from kFirstHollowShape on all are hollow parts.
enum class ShapeKind {
  kSuperquadric,  ///< between box, ball, cylinder and star, tilted
  kKnot,          ///< a tube along a torus knot
  kExtrusion,     ///< a star's or gear's profile, twisted and tapered
  kBlob,          ///< a ball displaced by smooth noise
  kLathe,         ///< a profile turned round the vertical: vase, bowl, pawn
  kFurniture,     ///< boxes that stand on and in each other: tables, shelves, chairs
  kCreature,      ///< a body on two or four legs, with head, tail, horns (jointed_shapes.h)
  kWheel,         ///< rim, hub and spokes
  kMachinePart,   ///< plates, tubes, bars and flanges at right angles
  kHollowPart     ///< sleeves, housings and spools, with a bore
};
constexpr int kStandingKinds = 6, kTurnedKinds = 9, kShapeKinds = 10;
/// From here on shapes are stretched along their axes, too, and half of them lie on a side, on their head or anyhow.
constexpr std::uint64_t kFirstTurnedShape = 10'000, kFirstHollowShape = 20'000;

std::string_view name_of(ShapeKind kind);
ShapeKind kind_of_shape(std::uint64_t number);

/// Object number `number` (1, 2, …) of an endless row of objects to train and to test on. z up, of any size and place:
/// load_mesh scales it and sets it down. The same number gives the same mesh. \pre number > 0
PlyModel procedural_shape(std::uint64_t number);

}  // namespace vantage
