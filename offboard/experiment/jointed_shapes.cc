#include "offboard/experiment/jointed_shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/experiment/shape_surfaces.h"

namespace vantage {
namespace {

using std::numbers::pi;

/// The tube and its mirror image across y = 0.
void add_pair(std::vector<TubeStation> stations, PlyModel* mesh) {
  add_tube(stations, mesh);
  for (TubeStation& station : stations) station.centre.y() = -station.centre.y();
  add_tube(stations, mesh);
}

/// A head at the end of a neck: a tube from the nape to the mouth, and what grows on it.
void add_head(const Eigen::Vector3d& nape, double size, SplitMix* random, PlyModel* mesh) {
  const double muzzle = random->uniform(0.6, 2.2) * size, droop = random->uniform(-0.5, 0.2);
  const Eigen::Vector3d mouth = nape + muzzle * Eigen::Vector3d(1, 0, droop);
  add_tube({{nape - Eigen::Vector3d(0.5 * size, 0, 0), size},
            {nape + Eigen::Vector3d(0.3 * size, 0, 0), size},
            {mouth, size * random->uniform(0.35, 0.8)}},
           mesh);
  if (random->uniform() < 0.5) {  // ears or horns
    const double length = random->uniform(0.6, 2.5) * size, thick = random->uniform(0.15, 0.35) * size;
    const Eigen::Vector3d root = nape + Eigen::Vector3d(0, 0.5 * size, 0.7 * size);
    const Eigen::Vector3d bend{random->uniform(-0.6, 0.6), random->uniform(0, 0.8), 0.6};
    const Eigen::Vector3d tip{random->uniform(-0.8, 0.8), random->uniform(0.2, 1), 1};
    add_pair({{root, thick}, {root + 0.6 * length * bend, 0.8 * thick}, {root + length * tip, 0.4 * thick}}, mesh);
  }
}

PlyModel four_legged(SplitMix* random) {
  PlyModel mesh;
  const double girth = random->uniform(0.13, 0.32), sag = random->uniform(-0.12, 0.12);
  const double shoulder = girth * random->uniform(0.7, 1.1), hip = girth * random->uniform(0.7, 1.2);
  add_tube({{{-0.5, 0, 0}, hip}, {{0, 0, sag}, girth}, {{0.5, 0, random->uniform(-0.1, 0.2)}, shoulder}}, &mesh);
  const double leg = random->uniform(0.3, 0.9), thick = girth * random->uniform(0.2, 0.5);
  for (const double x : {-0.42, 0.42}) {
    const double bend = random->uniform(-0.12, 0.12), apart = girth * random->uniform(0.5, 0.8);
    const double step = random->uniform(-0.1, 0.1);
    add_pair({{{x, apart, 0}, 1.3 * thick},
              {{x + bend, apart, -0.5 * (leg + girth)}, thick},
              {{x + step, apart, -leg - girth}, 0.8 * thick}},
             &mesh);
  }
  const double neck = random->uniform(0.1, 0.7), rise = random->uniform(0, 1.3);
  const Eigen::Vector3d nape = Eigen::Vector3d(0.5, 0, 0) + neck * Eigen::Vector3d(std::cos(rise), 0, std::sin(rise));
  const double head = girth * random->uniform(0.35, 0.9);
  add_tube({{{0.4, 0, 0}, 0.8 * shoulder}, {nape, 0.8 * head}}, &mesh);
  add_head(nape, head, random, &mesh);
  if (random->uniform() < 0.75) {  // a tail
    const double length = random->uniform(0.2, 1), hang = random->uniform(-0.9, 0.5), sway = random->uniform(-0.3, 0.3);
    const double root = hip * random->uniform(0.15, 0.7);
    add_tube({{{-0.45, 0, 0}, root},
              {Eigen::Vector3d(-0.5 - 0.5 * length, 0.3 * sway * length, 0.6 * hang * length), 0.7 * root},
              {Eigen::Vector3d(-0.5 - length, sway * length, hang * length), 0.3 * root}},
             &mesh);
  }
  return mesh;
}

PlyModel two_legged(SplitMix* random) {
  PlyModel mesh;
  const double girth = random->uniform(0.13, 0.26);
  add_tube({{{0, 0, 0}, girth * random->uniform(0.8, 1.2)},
            {{random->uniform(-0.1, 0.1), 0, 0.35}, girth},
            {{random->uniform(-0.1, 0.1), 0, 0.75}, girth * random->uniform(0.6, 1)}},
           &mesh);
  const double leg = random->uniform(0.4, 1), thick = girth * random->uniform(0.3, 0.55);
  const double apart = girth * random->uniform(0.5, 0.9), spread = random->uniform(0, 0.25);
  add_pair({{{0, apart, 0.5 * girth}, 1.2 * thick},
            {{random->uniform(-0.1, 0.1), apart + 0.5 * spread, -0.5 * leg}, thick},
            {{random->uniform(-0.1, 0.1), apart + spread, -leg}, 0.8 * thick}},
           &mesh);
  add_pair({{{0, 0.8 * girth, 0.7}, 0.8 * thick},
            {{random->uniform(-0.1, 0.2), girth + random->uniform(0.05, 0.3), random->uniform(0.3, 0.7)}, 0.7 * thick},
            {{random->uniform(0, 0.5), girth + random->uniform(0, 0.5), random->uniform(0.1, 1)}, 0.6 * thick}},
           &mesh);
  const double head = girth * random->uniform(0.6, 1.3);
  const Eigen::Vector3d nape(0, 0, 0.75 + girth + 0.8 * head);
  add_tube({{{0, 0, 0.7}, 0.6 * head}, {nape, 0.6 * head}}, &mesh);
  add_head(nape, head, random, &mesh);
  return mesh;
}

/// Along a random axis, at a random place near the middle.
void place_part(std::size_t first, double spread, SplitMix* random, PlyModel* part) {
  const std::uint64_t axis = random->next() % 3;
  if (axis < 2) {
    const Eigen::Vector3d about = axis == 0 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    turn(Eigen::AngleAxisd(pi / 2, about).toRotationMatrix(), part, first);
  }
  const Eigen::Vector3d offset{random->uniform(-spread, spread), random->uniform(-spread, spread),
                               random->uniform(-spread, spread)};
  shift(offset, part, first);
}

struct HollowSection {
  double radius, hole, low, high;
};

/// What is fixed to a section, from the middle of its wall outwards.
void add_boss(const HollowSection& on, SplitMix* random, PlyModel* mesh) {
  const std::size_t first = mesh->points.size();
  const double inner = 0.5 * (on.hole + on.radius), outer = on.radius + random->uniform(0.05, 0.6);
  if (random->uniform() < 0.5) {  // a round one
    const double thick = random->uniform(0.08, 0.4), bore = random->uniform() < 0.4 ? random->uniform(0.3, 0.8) : 0;
    add_ring([&](double) { return thick; }, bore * thick, inner, outer, mesh);
    turn(Eigen::AngleAxisd(pi / 2, Eigen::Vector3d::UnitY()).toRotationMatrix(), mesh, first);
    shift({0, 0, random->uniform(on.low, on.high)}, mesh, first);
  } else {  // a foot or a rib
    const double half = random->uniform(0.08, 1) * on.radius, low = random->uniform(-0.3, 0.6);
    add_box({inner, -half, on.low + low * (on.high - on.low)}, {outer, half, on.high}, mesh);
  }
  turn(Eigen::AngleAxisd(random->uniform(0, 2 * pi), Eigen::Vector3d::UnitZ()).toRotationMatrix(), mesh, first);
}

}  // namespace

PlyModel creature(SplitMix* random) { return random->uniform() < 0.7 ? four_legged(random) : two_legged(random); }

PlyModel wheel(SplitMix* random) {
  PlyModel mesh;
  const double inner = random->uniform(0.4, 0.85), height = random->uniform(0.08, 0.5);
  const bool toothed = random->uniform() < 0.4;
  const int teeth = 8 + static_cast<int>(random->next() % 16);
  const double tooth = toothed ? random->uniform(0.06, 0.2) : 0;
  add_ring([&](double angle) { return 1 - (std::cos(teeth * angle) < 0 ? tooth : 0); }, std::min(inner, 0.95 - tooth),
           0, height, &mesh);
  const double hub = random->uniform(0.12, 0.3), bore = hub * random->uniform(0, 0.8),
               hub_height = random->uniform(0.5, 2) * height, low = random->uniform(0, 0.5) * height;
  add_ring([&](double) { return hub; }, bore < 0.3 * hub ? 0 : bore, low, low + hub_height, &mesh);
  if (random->uniform() < 0.3) {  // a web
    add_ring([&](double) { return inner + 0.02; }, hub, 0.4 * height, 0.6 * height, &mesh);
    return mesh;
  }
  const int spokes = 3 + static_cast<int>(random->next() % 5);
  const double width = random->uniform(0.04, 0.12), slant = random->uniform(-0.6, 0.6);
  const double bottom = random->uniform(0, 0.4) * height, top = random->uniform(0.5, 1) * height;
  for (int i = 0; i < spokes; ++i) {
    const std::size_t first = mesh.points.size();
    add_box({hub * 0.9, -width, bottom}, {inner + 0.02, width, top}, &mesh);
    const Eigen::AngleAxisd blade(slant, Eigen::Vector3d::UnitX()),
        round(2 * pi * i / spokes, Eigen::Vector3d::UnitZ());
    shift({0, 0, -0.5 * height}, &mesh, first);
    turn((round * blade).toRotationMatrix(), &mesh, first);
    shift({0, 0, 0.5 * height}, &mesh, first);
  }
  return mesh;
}

PlyModel machine_part(SplitMix* random) {
  PlyModel mesh;
  const int count = 2 + static_cast<int>(random->next() % 4);
  for (int i = 0; i < count; ++i) {
    const std::size_t first = mesh.points.size();
    const double chance = random->uniform(), size = random->uniform(0.3, 1);
    if (chance < 0.3) {  // a plate or block
      const Eigen::Vector3d half{size, size * random->uniform(0.4, 1), random->uniform(0.06, 0.4)};
      add_box(-half, half, &mesh);
    } else if (chance < 0.6) {  // a tube, or a round bar
      const double radius = 0.5 * size, wall = random->uniform(0.15, 1.4), length = random->uniform(0.4, 1.6);
      add_ring([&](double) { return radius; }, std::max(0.0, 1 - wall) * radius, -length / 2, length / 2, &mesh);
    } else if (chance < 0.8) {  // a flange: flat, with a hole
      const int corners = 2 + static_cast<int>(random->next() % 5);
      const double lobe = random->uniform(0, 0.35), thick = random->uniform(0.05, 0.2);
      add_ring([&](double angle) { return size * (1 - lobe * (0.5 - 0.5 * std::cos(corners * angle))); },
               size * random->uniform(0.1, 0.55), -thick, thick, &mesh);
    } else {  // a bar of many corners
      const int corners = 3 + static_cast<int>(random->next() % 4);
      const double length = random->uniform(0.4, 1.6);
      const auto edge = [&](double angle) {
        const double sector = 2 * pi / corners, from_middle = std::fmod(angle, sector) - 0.5 * sector;
        return 0.5 * size * std::cos(0.5 * sector) / std::cos(from_middle);
      };
      add_ring(edge, 0, -length / 2, length / 2, &mesh);
    }
    place_part(first, i == 0 ? 0 : 0.35, random, &mesh);
  }
  return mesh;
}

PlyModel hollow_part(SplitMix* random) {
  std::vector<HollowSection> sections(1 + random->next() % 4);
  double narrowest = 1, z = 0;
  for (HollowSection& section : sections) {
    const double length = random->uniform(0.1, 0.9);
    section = {random->uniform(0.4, 1), 0, z, z + length};
    narrowest = std::min(narrowest, section.radius);
    z += length;
  }
  const bool stepped = random->uniform() < 0.5, blind = random->uniform() < 0.25;
  const double bore = narrowest * random->uniform(0.3, 0.93);
  for (HollowSection& section : sections) {
    section.hole = stepped ? section.radius * random->uniform(0.25, 0.93) : bore;
  }
  if (blind && sections.size() > 1) sections.front().hole = 0;

  PlyModel mesh;
  for (const HollowSection& section : sections) {
    const int corners = random->uniform() < 0.25 ? 2 + static_cast<int>(random->next() % 5) : 0;
    const double lobe = 0.5 * random->uniform() * (section.radius - section.hole);
    const auto edge = [&](double angle) {
      return section.radius - (corners == 0 ? 0 : lobe * (0.5 - 0.5 * std::cos(corners * angle)));
    };
    add_ring(edge, section.hole, section.low, section.high, &mesh);
  }
  const std::uint64_t bosses = random->next() % 3;
  for (std::uint64_t i = 0; i < bosses; ++i) add_boss(sections[random->next() % sections.size()], random, &mesh);
  return mesh;
}

}  // namespace vantage
