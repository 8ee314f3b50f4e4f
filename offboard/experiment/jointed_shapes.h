#pragma once

#include "calib/files/ply.h"
#include "offboard/experiment/split_mix.h"

namespace vantage {

// Objects put together of simple solids that stand in each other, as made: z up, any size and place.

/// A body on four legs, or on two with arms; neck, head, most with a tail, some with ears or horns.
PlyModel creature(SplitMix* random);
/// A rim with a hub and spokes, or a toothed one, flat on the ground.
PlyModel wheel(SplitMix* random);
/// Two to five of plates, tubes, bars and flanges along the axes.
PlyModel machine_part(SplitMix* random);
/// Rings of several sizes on one axis, with a bore through all or into one end: sleeves, housings, spools; some with
/// bosses or a foot outside.
PlyModel hollow_part(SplitMix* random);

}  // namespace vantage
