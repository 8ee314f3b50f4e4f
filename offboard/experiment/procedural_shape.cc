#include "offboard/experiment/procedural_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/experiment/jointed_shapes.h"
#include "offboard/experiment/shape_surfaces.h"
#include "offboard/experiment/split_mix.h"

namespace vantage {
namespace {

using std::numbers::pi;

Eigen::Matrix3d any_tilt(SplitMix* random) {
  const double azimuth = random->uniform(0, 2 * pi), tilt = random->uniform(0, pi / 2);
  return (Eigen::AngleAxisd(azimuth, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Matrix3d about_vertical(SplitMix* random) {
  return Eigen::AngleAxisd(random->uniform(0, 2 * pi), Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

/// Barr, "Superquadrics and angle-preserving transformations", 1981.
PlyModel superquadric(SplitMix* random) {
  const double e1 = random->uniform(0.2, 2.2), e2 = random->uniform(0.2, 2.2);
  const Eigen::Vector3d axes{1, random->uniform(0.4, 1), random->uniform(0.4, 1.2)};
  const auto power = [](double x, double e) { return std::copysign(std::pow(std::abs(x), e), x); };
  PlyModel mesh;
  add_surface(
      [&](double u, double v) {
        const double longitude = 2 * pi * u, latitude = pi * (v - 0.5), c = power(std::cos(latitude), e1);
        return Eigen::Vector3d(axes.x() * c * power(std::cos(longitude), e2),
                               axes.y() * c * power(std::sin(longitude), e2), axes.z() * power(std::sin(latitude), e1));
      },
      96, 48, &mesh);
  turn(any_tilt(random), &mesh);
  return mesh;
}

PlyModel knot(SplitMix* random) {
  constexpr std::array<std::array<int, 2>, 6> kTurns = {{{1, 2}, {2, 3}, {3, 2}, {2, 5}, {3, 4}, {1, 3}}};
  const auto [p, q] = kTurns[random->next() % kTurns.size()];
  const double small = random->uniform(0.3, 0.5), tube = random->uniform(0.12, 0.26),
               height = random->uniform(0.7, 1.4);
  const auto centre = [&](double t) {
    const double r = 1 + small * std::cos(q * t);
    return Eigen::Vector3d(r * std::cos(p * t), r * std::sin(p * t), height * small * std::sin(q * t));
  };
  PlyModel mesh;
  add_surface(
      [&](double u, double v) {
        const double t = 2 * pi * u, angle = 2 * pi * v;
        const Eigen::Vector3d along = (centre(t + 1e-4) - centre(t - 1e-4)).normalized();
        const Eigen::Vector3d out(std::cos(p * t), std::sin(p * t), 0);
        const Eigen::Vector3d side = (out - along.dot(out) * along).normalized();
        return Eigen::Vector3d(centre(t) + tube * (std::cos(angle) * side + std::sin(angle) * along.cross(side)));
      },
      240, 16, &mesh);
  turn(any_tilt(random), &mesh);
  return mesh;
}

PlyModel extrusion(SplitMix* random) {
  const int points = 3 + static_cast<int>(random->next() % 6);
  const double depth = random->uniform(0.1, 0.45), sharpness = random->uniform(0.5, 3);
  const double twist = random->uniform(-1.5, 1.5), taper = random->uniform(-0.6, 0.2),
               height = random->uniform(0.5, 2.5);
  const auto at = [&](double share, double angle, double z) {
    const double wave = std::pow(0.5 + 0.5 * std::cos(points * angle), sharpness);
    const double r = share * (1 - depth + depth * wave) * (1 + taper * z);
    return Eigen::Vector3d(r * std::cos(angle + twist * z), r * std::sin(angle + twist * z), height * z);
  };
  PlyModel mesh;
  add_surface([&](double u, double v) { return at(1, 2 * pi * u, v); }, 144, 24, &mesh);
  for (const double end : {0.0, 1.0})
    add_surface([&](double u, double v) { return at(v, 2 * pi * u, end); }, 144, 4, &mesh);
  return mesh;
}

PlyModel blob(SplitMix* random) {
  struct Wave {
    Eigen::Vector3d direction;
    double phase, height;
  };
  std::vector<Wave> waves;
  const double roughness = random->uniform(0.08, 0.3);
  for (int i = 0; i < 24; ++i) {
    const Eigen::Vector3d direction{random->normal(), random->normal(), random->normal()};  // braces: in this order
    const double frequency = random->uniform(1.5, 7);
    waves.push_back({frequency * direction.normalized(), random->uniform(0, 2 * pi), roughness / std::sqrt(frequency)});
  }
  const Eigen::Vector3d axes{1, random->uniform(0.5, 1), random->uniform(0.5, 1.3)};
  PlyModel mesh;
  add_surface(
      [&](double u, double v) {
        const double longitude = 2 * pi * u, latitude = pi * (v - 0.5);
        const Eigen::Vector3d unit(std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                                   std::sin(latitude));
        double r = 1;
        for (const Wave& wave : waves) r += wave.height * std::sin(wave.direction.dot(unit) + wave.phase);
        return Eigen::Vector3d(std::max(r, 0.2) * unit.cwiseProduct(axes));
      },
      128, 64, &mesh);
  return mesh;
}

PlyModel lathe(SplitMix* random) {
  std::array<double, 7> radius{};
  for (double& r : radius) r = random->uniform(0.15, 1);
  const double height = random->uniform(0.8, 2.6), bowl = random->uniform(0, 0.9);
  const auto profile = [&](double z) {
    const double at = z * (radius.size() - 1);
    const auto i = std::min(static_cast<std::ptrdiff_t>(at), static_cast<std::ptrdiff_t>(radius.size()) - 2);
    const double t = at - static_cast<double>(i);
    const auto r = [&](std::ptrdiff_t k) {
      return radius[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, std::ssize(radius) - 1))];
    };
    return std::max(0.1, catmull_rom(r(i - 1), r(i), r(i + 1), r(i + 2), t));
  };
  PlyModel mesh;
  const auto at = [&](double r, double angle, double z) {
    return Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z);
  };
  add_surface([&](double u, double v) { return at(profile(v), 2 * pi * u, height * v); }, 96, 72, &mesh);
  add_surface([&](double u, double v) { return at(v * profile(0), 2 * pi * u, 0); }, 96, 4, &mesh);
  // The top is hollowed like a bowl, down to a share of the height.
  add_surface([&](double u,
                  double v) { return at(v * profile(1) * 0.98, 2 * pi * u, height * (1 - bowl * 0.4 * (1 - v * v))); },
              96, 12, &mesh);
  add_surface([&](double u, double v) { return at((0.98 + 0.02 * v) * profile(1), 2 * pi * u, height); }, 96, 1, &mesh);
  return mesh;
}

PlyModel furniture(SplitMix* random) {
  PlyModel mesh;
  const double width = random->uniform(0.7, 1.4), depth = random->uniform(0.6, 1), height = random->uniform(0.5, 1.2);
  const double leg = random->uniform(0.07, 0.16), plate = random->uniform(0.06, 0.15);
  for (const double x : {0.0, width - leg}) {
    for (const double y : {0.0, depth - leg}) add_box({x, y, 0}, {x + leg, y + leg, height}, &mesh);
  }
  add_box({0, 0, height}, {width, depth, height + plate}, &mesh);
  if (random->uniform() < 0.6) {  // a back
    add_box({0, depth - leg, height}, {width, depth, height + plate + random->uniform(0.3, 0.9)}, &mesh);
  }
  if (random->uniform() < 0.5) {  // a shelf between the legs
    const double z = random->uniform(0.2, 0.6) * height;
    add_box({0, 0, z}, {width, depth, z + 0.5 * plate}, &mesh);
  }
  const int things = static_cast<int>(random->next() % 3);
  for (int i = 0; i < things; ++i) {
    const double x = random->uniform(0, 0.6) * width, y = random->uniform(0, 0.5) * depth, z = height + plate;
    const Eigen::Vector3d size{random->uniform(0.15, 0.4), random->uniform(0.15, 0.4), random->uniform(0.1, 0.5)};
    add_box({x, y, z}, Eigen::Vector3d(x, y, z) + size, &mesh);
  }
  turn(about_vertical(random), &mesh);
  return mesh;
}

PlyModel shape_of(ShapeKind kind, SplitMix* random) {
  switch (kind) {
    case ShapeKind::kSuperquadric:
      return superquadric(random);
    case ShapeKind::kKnot:
      return knot(random);
    case ShapeKind::kExtrusion:
      return extrusion(random);
    case ShapeKind::kBlob:
      return blob(random);
    case ShapeKind::kLathe:
      return lathe(random);
    case ShapeKind::kCreature:
      return creature(random);
    case ShapeKind::kWheel:
      return wheel(random);
    case ShapeKind::kMachinePart:
      return machine_part(random);
    case ShapeKind::kHollowPart:
      return hollow_part(random);
    case ShapeKind::kFurniture:
      break;
  }
  return furniture(random);
}

/// As things lie about: half as they were made, a third on a side or upside down, the rest anyhow.
void stretch_and_turn(SplitMix* random, PlyModel* mesh) {
  const Eigen::Vector3d log_scale{random->uniform(-0.4, 0.4), random->uniform(-0.4, 0.4), random->uniform(-0.4, 0.4)};
  const Eigen::Vector3d scale = log_scale.array().exp();
  Eigen::Matrix3d attitude = Eigen::Matrix3d::Identity();
  const double chance = random->uniform();
  if (chance > 0.85) {
    const Eigen::Vector4d q{random->normal(), random->normal(), random->normal(), random->normal()};
    attitude = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
  } else if (chance > 0.5) {
    const int quarters = chance > 0.8 ? 2 : 1;
    const Eigen::Vector3d axis = chance > 0.65 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    attitude = Eigen::AngleAxisd(quarters * pi / 2, axis).toRotationMatrix();
  }
  turn(about_vertical(random) * attitude * scale.asDiagonal(), mesh);
}

}  // namespace

std::string_view name_of(ShapeKind kind) {
  constexpr std::array<std::string_view, kShapeKinds> kNames = {"superquadric", "knot",       "extrusion", "blob",
                                                                "lathe",        "furniture",  "creature",  "wheel",
                                                                "machine part", "hollow part"};
  return kNames[static_cast<std::size_t>(kind)];
}

ShapeKind kind_of_shape(std::uint64_t number) {
  if (number >= kFirstHollowShape) return ShapeKind::kHollowPart;
  const std::uint64_t kinds = number < kFirstTurnedShape ? kStandingKinds : kTurnedKinds;
  return static_cast<ShapeKind>((number - 1) % kinds);
}

PlyModel procedural_shape(std::uint64_t number) {
  SplitMix random(number);
  PlyModel mesh = shape_of(kind_of_shape(number), &random);
  if (number >= kFirstTurnedShape) stretch_and_turn(&random, &mesh);
  return mesh;
}

}  // namespace vantage
