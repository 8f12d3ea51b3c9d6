#include "components/lidar_odometry/surfel.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "components/lidar_odometry/directional_information.hpp"
#include "components/lidar_odometry/range_image.hpp"
#include "components/lidar_odometry/surfel_map.hpp"
#include "components/lidar_odometry/surfel_registration.hpp"
#include "components/lidar_odometry/test_scene.hpp"

namespace adit::lidar_odometry {
namespace {

std::vector<Surfel> surfels_of(const RecordedSweep& sweep, ScanCounters* counters = nullptr) {
  RangeImage image;
  WorkerPool pool(1);
  std::vector<Surfel> surfels;
  ScanCounters own;
  SurfelExtractor(Config{}).extract(image.organise(sweep.cloud()), pool, surfels, counters ? *counters : own);
  return surfels;
}

TEST(RangeImage, RebuildsTheRowsAndColumnsOfAShuffledSweep) {
  ScannerModel model;
  model.noise = 0.0;
  const RecordedSweep organised = scan(hall(), model, Pose::Identity(), Vector6d::Zero(), 0, 1);
  for (const bool with_rings : {true, false}) {
    RecordedSweep loose;
    for (std::size_t i = 0; i < organised.points.size(); ++i) {
      const std::size_t j = i * 7919 % organised.points.size();  // a permutation: the count is a power of two
      loose.points.push_back(organised.points[j]);
      loose.seconds.push_back(organised.seconds[j]);
      if (with_rings) loose.rings.push_back(static_cast<std::uint16_t>(j / organised.width));
    }
    RangeImage builder;
    const Cloud image = builder.organise(loose.cloud());
    EXPECT_EQ(image.height, organised.height);
    EXPECT_EQ(image.width, organised.width);
    // A pixel may be a column off where the azimuth lies on the edge of two.
    std::size_t same_row = 0, valid = 0;
    for (std::size_t r = 0; r < image.height; ++r) {
      for (std::size_t c = 0; c < image.width; ++c) {
        const Point3f p = image.points[r * image.width + c];
        if (!p.allFinite()) continue;
        ++valid;
        const float expected =
            std::atan2(organised.points[r * image.width].z(), organised.points[r * image.width].head<2>().norm());
        same_row += std::abs(std::atan2(p.z(), p.head<2>().norm()) - expected) < 1e-3f ? 1 : 0;
      }
    }
    EXPECT_EQ(same_row, valid);
    EXPECT_GT(valid, organised.points.size() * 9 / 10);
  }
}

TEST(RangeImage, TakesCloudsWithoutRings) {
  RecordedSweep sweep;
  for (int i = 0; i < 20000; ++i) {
    const double a = 0.7 * i;
    const double b = 0.4 * std::sin(0.37 * i);
    sweep.points.emplace_back(static_cast<float>(8.0 * std::cos(a)), static_cast<float>(8.0 * std::sin(a)),
                              static_cast<float>(8.0 * std::tan(b)));
  }
  RangeImage builder;
  const Cloud image = builder.organise(sweep.cloud());
  EXPECT_EQ(image.height, 64u);
  EXPECT_TRUE(consistent(image));
}

TEST(Surfels, LieOnTheSurfacesWithTheirNormals) {
  ScannerModel model;
  const RecordedSweep sweep = scan(smooth_tunnel(), model, Pose::Identity(), Vector6d::Zero(), 0, 3);
  const std::vector<Surfel> surfels = surfels_of(sweep);
  ASSERT_GT(surfels.size(), 500u);
  int wall = 0;
  double worst = 0.0;
  double sum = 0.0;
  for (const Surfel& s : surfels) {
    EXPECT_NEAR(s.normal.norm(), 1.0f, 1e-4f);
    EXPECT_LT(s.normal.dot(s.point), 0.0f);  // towards the sensor
    if (s.point.z() < 0.0f) continue;
    const Eigen::Vector3f radial(0.0f, s.point.y(), s.point.z());
    const double angle = std::acos(std::min(1.0f, -s.normal.dot(radial.normalized())));
    worst = std::max(worst, angle);
    sum += angle * angle;
    ++wall;
    EXPECT_NEAR(radial.norm(), 4.0f, 0.06f);
  }
  EXPECT_GT(wall, 300);
  EXPECT_LT(std::sqrt(sum / wall), 0.06);  // rad
}

TEST(Surfels, CountWhatIsDropped) {
  RecordedSweep sweep = scan(hall(), {}, Pose::Identity(), Vector6d::Zero(), 0, 1);
  const auto invalid = static_cast<std::uint32_t>(
      std::count_if(sweep.points.begin(), sweep.points.end(), [](const Point3f& p) { return !p.allFinite(); }));
  sweep.points[0] = Point3f::Zero();
  sweep.points[1] = Point3f(500.0f, 0.0f, 0.0f);
  sweep.points[2] = Point3f(0.1f, 0.0f, 0.0f);
  ScanCounters counters;
  surfels_of(sweep, &counters);
  EXPECT_EQ(counters.invalid, invalid + 1u);
  EXPECT_EQ(counters.out_of_range, 2u);
}

TEST(SurfelMap, AveragesPlanesAlsoFarFromTheOrigin) {
  for (const double x : {0.0, 1e4, -3e4}) {
    SurfelMap map(0.4, 80.0, 1024);
    std::vector<MapSurfel> surfels;
    for (int i = 0; i < 20; ++i) {
      surfels.push_back(
          {{x + 0.1 + 0.01 * i, 0.1 + 0.005 * (i % 5), 0.2 + (i % 2 == 0 ? 0.01 : -0.01)}, {0.0f, 0.0f, 1.0f}});
    }
    map.add(surfels, {x, 0.0, 0.0});
    const Cell cell = map.cell_at(surfels[0].point);
    const SurfelMap::Index index = map.find(cell);
    ASSERT_NE(index, SurfelMap::none);
    const SurfelMap::Plane& plane = map.plane(index);
    EXPECT_NEAR((map.centre(cell) + plane.mean.cast<double>()).z(), 0.2, 1e-6);
    EXPECT_NEAR(plane.normal.z(), 1.0f, 1e-6f);
    EXPECT_NEAR(plane.offset, 0.0f, 1e-6f);
    EXPECT_NEAR(plane.variance, 1e-4 / 20.0, 1e-6);
  }
}

TEST(SurfelMap, OffsetIsTheMeanNormalDistanceOfACurvedPatch) {
  SurfelMap map(0.4, 80.0, 64);
  std::vector<MapSurfel> surfels;
  for (int i = -8; i <= 8; ++i) {
    const double a = 0.02 * i;  // on a circle of 1 m about (0.2, 0, 1.2)
    surfels.push_back({{0.2 + std::sin(a), 0.2, 1.2 - std::cos(a)},
                       Eigen::Vector3f(-std::sin(static_cast<float>(a)), 0.0f, std::cos(static_cast<float>(a)))});
  }
  map.add(surfels, Eigen::Vector3d::Zero());
  const Cell cell = map.cell_at({0.2, 0.2, 0.2});
  const SurfelMap::Plane& plane = map.plane(map.find(cell));
  const Eigen::Vector3d q(0.25, 0.2, 0.23);
  double mean = 0.0, normals = 0.0;
  for (const MapSurfel& s : surfels) {
    mean += s.normal.cast<double>().dot(q - s.point) / static_cast<double>(surfels.size());
    normals += s.normal.cast<double>().dot(plane.normal.cast<double>()) / static_cast<double>(surfels.size());
  }
  const Eigen::Vector3f e = (q - map.centre(cell)).cast<float>() - plane.mean;
  EXPECT_NEAR(static_cast<double>(plane.normal.dot(e) - plane.offset) * normals, mean, 1e-5);
}

TEST(SurfelMap, IsBoundedAndForgetsWhatIsFar) {
  SurfelMap map(0.5, 20.0, 500);
  std::size_t evicted = 0;
  for (int k = 0; k < 400; ++k) {
    std::vector<MapSurfel> surfels;
    for (int i = 0; i < 60; ++i) surfels.push_back({{0.5 * k, 0.5 * i, 0.0}, {0.0f, 0.0f, 1.0f}});
    map.add(surfels, {0.5 * k, 15.0, 0.0});
    ASSERT_LE(map.cells(), 500u);
    evicted += map.evicted();
  }
  EXPECT_GT(evicted, 0u);
  EXPECT_NE(map.find(map.cell_at({199.5, 5.0, 0.0})), SurfelMap::none);
  EXPECT_EQ(map.find(map.cell_at({10.0, 5.0, 0.0})), SurfelMap::none);
  map.clear();
  EXPECT_TRUE(map.empty());
  EXPECT_EQ(map.find(map.cell_at({199.5, 5.0, 0.0})), SurfelMap::none);
}

// A static pair of sweeps of a hall: the registration brings a displaced guess back, at the origin and 10 km away.
TEST(SurfelRegistration, FindsADisplacedPoseAnywhere) {
  const Config config;
  const std::vector<Surfel> first = surfels_of(scan(hall(), {}, Pose::Identity(), Vector6d::Zero(), 0, 1));
  const std::vector<Surfel> second = surfels_of(scan(hall(), {}, Pose::Identity(), Vector6d::Zero(), 0, 2));
  Vector6d offset;
  offset << 0.1, -0.08, 0.05, 0.01, -0.008, 0.015;
  std::vector<Vector6d> errors;
  for (const double x : {0.0, 1e4}) {
    Pose base = Pose::Identity();
    base.translation().x() = x;
    SurfelMap map(config.surfel.cell_size, 80.0, 1 << 15);
    SurfelRegistration registration(config.surfel);
    WorkerPool pool(1);
    map.add(registration.place(first, base, {}, Vector6d::Zero()), base.translation());
    SurfelPrior loose;
    loose.information = 1e-3 * Matrix6d::Identity();
    const auto result = registration.align(second, map, base * se3_exp(offset), loose, {}, 0.5, 30, pool);
    errors.push_back(se3_log(base.inverse() * result.pose));
    EXPECT_LT(errors.back().head<3>().norm(), 0.01);
    EXPECT_LT(errors.back().tail<3>().norm(), 0.001);
    for (const bool observable : result.directions.observable) EXPECT_TRUE(observable);
  }
  EXPECT_LT((errors[0] - errors[1]).head<3>().norm(), 0.001);
}

// Robust weights change from solve to solve, the directions do not: a step needs the Hessian of its own weights. With
// the first one's, 50 times too soft, Gauss-Newton went 50 times too far.
TEST(DirectionalInformation, AttenuatesTheHessianItIsGiven) {
  std::vector<Constraint> constraints;
  Matrix6d hessian = Matrix6d::Zero();
  for (int i = 0; i < 600; ++i) {
    Constraint c;
    c.map_normal = c.source_normal = Eigen::Vector3f::Unit(i % 3);
    c.lever = Eigen::Vector3f(static_cast<float>(i % 7) - 3.0f, static_cast<float>(i % 11) - 5.0f,
                              static_cast<float>(i % 13) - 6.0f);
    c.weight = 4000.0f;
    c.cluster = static_cast<std::uint16_t>(i);
    Vector6d j;
    j << c.map_normal.cast<double>(), c.lever.cross(c.map_normal).cast<double>();
    hessian += 4000.0 * j * j.transpose();
    constraints.push_back(c);
  }
  DirectionalInformation analysis{SurfelConfig{}};
  const Directions directions = analysis.analyse(hessian, constraints);
  for (const bool observable : directions.observable) ASSERT_TRUE(observable);
  const Matrix6d stiffer = 50.0 * hessian;
  Matrix6d attenuated = stiffer;
  Vector6d gradient = Vector6d::Ones();
  analysis.attenuate(directions, attenuated, gradient);
  EXPECT_LT((attenuated - stiffer).norm(), 1e-9 * stiffer.norm());
  EXPECT_LT((gradient - Vector6d::Ones()).norm(), 1e-9);
}

// A sweep compensated with a wrong twist is displaced by what the lag says.
TEST(SurfelRegistration, TellsWhatAWrongMotionWithinTheSweepDoes) {
  const Config config;
  const std::vector<Surfel> first = surfels_of(scan(hall(), {}, Pose::Identity(), Vector6d::Zero(), 0, 1));
  const std::vector<Surfel> second = surfels_of(scan(hall(), {}, Pose::Identity(), Vector6d::Zero(), 0, 2));
  SurfelMap map(config.surfel.cell_size, 80.0, 1 << 15);
  SurfelRegistration registration(config.surfel);
  WorkerPool pool(1);
  map.add(registration.place(first, Pose::Identity(), {}, Vector6d::Zero()), Eigen::Vector3d::Zero());
  SurfelPrior loose;
  loose.information = 1e-3 * Matrix6d::Identity();
  const auto aligned = [&](const Vector6d& twist) {
    SweepTwist sweep;
    sweep.times = TimeSpan{0.0, 0.1};
    sweep.reference_time = 0.1;
    sweep.predicted = twist;
    return registration.align(second, map, Pose::Identity(), loose, sweep, 0.5, 30, pool);
  };
  const SurfelRegistrationResult still = aligned(Vector6d::Zero());
  for (int axis = 0; axis < 6; ++axis) {
    Vector6d wrong = Vector6d::Zero();
    wrong[axis] = axis < 3 ? 0.3 : 0.05;
    const Vector6d moved = se3_log(still.pose.inverse() * aligned(wrong).pose);
    const Vector6d told = still.lag * wrong;
    EXPECT_NEAR(still.lag(axis, axis), 0.05, 0.02) << axis;
    EXPECT_LT((moved - told).head<3>().norm(), 0.2 * told.head<3>().norm() + 1e-3) << axis;
    EXPECT_LT((moved - told).tail<3>().norm(), 0.2 * told.tail<3>().norm() + 1.5e-4) << axis;
  }
}

// Whenever in the sweep the evidence of the position lies: an error of the twist decays. The pose at the end is off by
// what the wrong twist makes of the time from the evidence to the end.
TEST(SweepTwist, ErrorsDecayWhereverTheEvidenceLies) {
  constexpr double period = 0.1, speed = 5.0;
  for (const double to_end : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    Vector6d used = Vector6d::Zero();
    Pose last = Pose::Identity();
    for (int sweep = 1; sweep <= 20; ++sweep) {
      SweepTwist twist;
      twist.times = TimeSpan{0.0, period};
      twist.reference_time = twist.dt = period;
      twist.predicted = used;
      twist.last = last;
      twist.last_middle = twist.middle(last, used);
      twist.translation_share = twist.rotation_share = SurfelConfig{}.deskew_share;
      Pose pose = Pose::Identity();
      for (int association = 0; association < 3; ++association) {
        if (association > 0) used = twist.refined(pose, used);
        pose.translation().x() = speed * period * sweep + to_end * period * (used[0] - speed);
      }
      last = pose;
    }
    EXPECT_NEAR(used[0], speed, 1e-3) << to_end;
    EXPECT_NEAR(last.translation().x(), 20 * period * speed, 1e-4) << to_end;
  }
}

}  // namespace
}  // namespace adit::lidar_odometry
