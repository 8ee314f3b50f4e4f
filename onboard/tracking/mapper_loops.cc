// Places seen again: loops closed, pieces of map joined.

#include "onboard/tracking/descriptor.h"
#include "onboard/tracking/mapper.h"
#include "onboard/tracking/pose_graph.h"

namespace vantage::tracking {
namespace {

constexpr std::size_t kRipe = 3;  // younger key frames, after which one's own seeds are points

}  // namespace

void Mapper::index_place(KeyFrameId id) {
  const std::lock_guard lock(mutex_);
  const KeyFrame* frame = map_.key_frame(id);
  std::vector<Descriptor> descriptors;
  for (const LandmarkId hosted : frame->hosted) {
    const Landmark* landmark = map_.landmark(hosted);
    if (landmark != nullptr && landmark->described) descriptors.push_back(landmark->descriptor);
  }
  for (const Feature& feature : frame->features) {
    Descriptor descriptor;
    if (!feature.edgelet && describe(frame->image->level(feature.level), to_level(feature.pixel.x(), feature.level),
                                     to_level(feature.pixel.y(), feature.level), &descriptor)) {
      descriptors.push_back(descriptor);
    }
  }
  places_.add(id, descriptors);
}

KeyFrameId Mapper::ripe_key_frame() const {
  const std::lock_guard lock(mutex_);
  const int piece = piece_of(newest_);
  std::size_t younger = 0;
  for (auto frame = map_.key_frames().rbegin(); frame != map_.key_frames().rend(); ++frame) {
    if (frame->second.map == piece && younger++ == kRipe) return frame->first;
  }
  return 0;
}

void Mapper::close_loop(KeyFrameId id) {
  std::optional<LoopMatch> match;
  PoseGraph graph;
  std::vector<KeyFrameId> ids;
  bool metric = false;
  {
    const std::lock_guard lock(mutex_);
    const KeyFrame* query = map_.key_frame(id);
    if (query == nullptr) return;
    metric = query->prior.has_value();
    match = loop_closer_.find(map_, places_, id, metric);
    if (!match) return;
    const int from = query->map, into = map_.key_frame(match->place)->map;
    if (from != into) {
      // Another piece of map: it is brought over whole.
      const Similarity S_world_world = Similarity::from(map_.key_frame(match->place)->T_camera_world).inverse() *
                                       match->S_place_query * Similarity::from(query->T_camera_world);
      for (auto& [other, frame] : map_.key_frames()) {
        if (frame.map != from) continue;
        map_.move_key_frame(&frame, S_world_world);
        frame.map = into;
        note_correction(frame);
      }
    } else {
      std::map<KeyFrameId, int> index;
      for (const auto& [other, frame] : map_.key_frames()) {
        if (frame.map != into) continue;
        index[other] = static_cast<int>(graph.nodes.size());
        ids.push_back(other);
        graph.nodes.push_back({Similarity::from(frame.T_camera_world), other == match->place});
      }
      for (std::size_t i = 0; i < ids.size(); ++i) {
        const auto connect_nodes = [&](KeyFrameId other) {
          const auto j = static_cast<std::size_t>(index.at(other));
          graph.edges.push_back({static_cast<int>(i), static_cast<int>(j),
                                 graph.nodes[i].S_camera_world * graph.nodes[j].S_camera_world.inverse(), 1});
        };
        if (i > 0) connect_nodes(ids[i - 1]);
        int edges = 0;
        for (const auto& [other, shared] : map_.covisible(ids[i])) {
          if (shared < 20 || ++edges > 5) break;
          if (index.count(other) != 0 && other < ids[i] && (i == 0 || other != ids[i - 1])) connect_nodes(other);
        }
      }
      graph.edges.push_back(
          {index.at(match->place), index.at(id), match->S_place_query, static_cast<double>(ids.size())});
    }
  }
  if (!ids.empty()) {
    if (!optimise(&graph, !metric)) return;
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      KeyFrame* frame = map_.key_frame(ids[i]);
      if (frame == nullptr) continue;
      map_.move_key_frame(frame, graph.nodes[i].S_camera_world.inverse() * Similarity::from(frame->T_camera_world));
      note_correction(*frame);
    }
  }
  {
    const std::lock_guard lock(mutex_);
    ++loops_closed_;
    for (const auto& [kept, gone] : match->pairs) map_.merge_landmarks(kept, gone);
  }
  adjust_locally(id);
}

}  // namespace vantage::tracking
