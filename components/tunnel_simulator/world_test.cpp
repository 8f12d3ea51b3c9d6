#include "components/tunnel_simulator/world.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "components/tunnel_simulator/atmosphere.hpp"
#include "components/tunnel_simulator/lining_texture.hpp"
#include "components/tunnel_simulator/noise.hpp"
#include "components/tunnel_simulator/ray_caster.hpp"
#include "components/tunnel_simulator/test_worlds.hpp"

namespace adit::tunnel_simulator {
namespace {

TEST(Noise, HasZeroMeanAndUnitVariance) {
  double sum2 = 0, square2 = 0, sum3 = 0, square3 = 0;
  const int n = 300;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double a = value_noise(0.37F * static_cast<float>(i), 0.41F * static_cast<float>(j), 1U);
      const double b = fractal_noise(0.37F * static_cast<float>(i), 0.41F * static_cast<float>(j),
                                     0.29F * static_cast<float>(i + j), 3, 0.6F, 2U);
      sum2 += a;
      square2 += a * a;
      sum3 += b;
      square3 += b * b;
    }
  }
  const double count = n * n;
  EXPECT_NEAR(sum2 / count, 0.0, 0.05);
  EXPECT_NEAR(square2 / count, 1.0, 0.08);
  EXPECT_NEAR(sum3 / count, 0.0, 0.05);
  EXPECT_NEAR(square3 / count, 1.0, 0.1);
}

TEST(Profile, DistanceAndArcLength) {
  const Profile box = box_profile(4.0, 3.0, Material::concrete, Material::concrete);
  EXPECT_NEAR(box.distance(0.0, 1.0), -1.0, 1e-12);
  EXPECT_NEAR(box.distance(3.0, 1.0), 1.0, 1e-12);
  EXPECT_NEAR(box.perimeter(), 14.0, 1e-12);
  EXPECT_NEAR(box.at(box.u_at_height(1.0, 1.0)).x(), 2.0, 1e-12);
  EXPECT_NEAR(box.at(box.u_at_height(1.0, -1.0)).x(), -2.0, 1e-12);
  EXPECT_NEAR(box.at(box.u_nearest({0.3, 5.0})).y(), 3.0, 1e-12);
  const Profile road = road_profile({}, Material::concrete);
  EXPECT_NEAR(road.max().y(), 6.9, 0.01);
  EXPECT_LT(road.distance(0.0, 3.0), -2.5);
  EXPECT_GT(road.at(road.u_at_height(1.0, 1.0)).x(), 4.75);  // clear width 9.5 m at 1 m height
}

// Sends rays in all directions from places inside: whatever the openings, walls must be closed.
double leak_share(const World& world, const std::vector<Eigen::Vector3d>& eyes, int rays) {
  RayCaster caster(world, {200.0, false, 1});
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  int cast = 0, lost = 0;
  for (const Eigen::Vector3d& eye : eyes) {
    caster.look_from(eye);
    for (int k = 0; k < rays; ++k) {
      RayPacket packet;
      packet.time.fill(0.0F);
      for (std::size_t lane = 0; lane < kPacket; ++lane) {
        const Eigen::Vector3d d = Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
        const Eigen::Vector3d from = eye - caster.origin();
        packet.ox[lane] = static_cast<float>(from.x());
        packet.oy[lane] = static_cast<float>(from.y());
        packet.oz[lane] = static_cast<float>(from.z());
        packet.dx[lane] = static_cast<float>(d.x());
        packet.dy[lane] = static_cast<float>(d.y());
        packet.dz[lane] = static_cast<float>(d.z());
        packet.far[lane] = 1000.0F;
      }
      caster.cast(packet);
      for (std::size_t lane = 0; lane < kPacket; ++lane) {
        ++cast;
        lost += packet.hit(lane) ? 0 : 1;
      }
    }
  }
  return static_cast<double>(lost) / cast;
}

WorldDescription two_tubes(double roughness) {
  WorldDescription world = plain_tube(road_profile({}, Material::concrete), {}, 60.0);
  VolumeDescription second = world.volumes[0];
  second.name = "second";
  second.line = world.volumes[0].line.parallel(-25.0);
  world.volumes.push_back(second);
  for (VolumeDescription& v : world.volumes) {
    v.lining.roughness = roughness;
    v.equipment = equipment_of(VolumeKind::road, 2);
    v.equipment.niches = 40.0;
  }
  add_passage(world, 0, 1, 30.0, 3.6, 4.0);
  add_niches(world);
  return world;
}

TEST(World, WallsAreClosedThroughPassagesAndNiches) {
  for (double roughness : {0.0, 0.012}) {
    const World world(two_tubes(roughness));
    const double leak =
        leak_share(world, {{30.0, 0.0, 2.0}, {30.0, -12.5, 1.8}, {20.0, 1.0, 1.5}, {45.0, -25.0, 2.0}}, 4000);
    EXPECT_LT(leak, 2e-5) << roughness;
  }
}

TEST(World, OpeningsAreOpen) {
  const World world(two_tubes(0.01));
  EXPECT_LT(world.field({30.0, -12.5, 2.0}), -1.0);  // in the passage
  EXPECT_GT(world.field({15.0, -12.5, 2.0}), 1.0);   // in the rock
  RayCaster caster(world, {200.0, false, 1});
  const Eigen::Vector3d eye(30.0, 0.0, 1.5);
  caster.look_from(eye);
  RayPacket packet;
  packet.time.fill(0.0F);
  packet.far.fill(-1.0F);
  packet.ox[0] = static_cast<float>(eye.x() - caster.origin().x());
  packet.oy[0] = static_cast<float>(eye.y() - caster.origin().y());
  packet.oz[0] = static_cast<float>(eye.z() - caster.origin().z());
  packet.dx[0] = 0.0F;
  packet.dy[0] = -1.0F;
  packet.dz[0] = 0.0F;
  packet.far[0] = 100.0F;
  caster.cast(packet);
  ASSERT_TRUE(packet.hit(0));
  EXPECT_NEAR(packet.far[0], 25.0 + 5.3, 0.3);  // through the passage to the far wall of the other tube
}

TEST(World, ChunksMeetWithoutOrderOrThreads) {
  const World world(two_tubes(0.012));
  for (std::size_t i = 0; i < world.chunks().size(); ++i) {
    const Mesh a = world.build_mesh(i);
    const Mesh b = world.build_mesh(i);
    ASSERT_EQ(a.vertices.size(), b.vertices.size());
    for (std::size_t k = 0; k < a.vertices.size(); ++k) {
      ASSERT_EQ(a.vertices[k].position, b.vertices[k].position);
      ASSERT_TRUE(a.vertices[k].position.allFinite());
    }
  }
}

TEST(World, RoughnessHasTheConfiguredHeight) {
  WorldDescription d = plain_tube(box_profile(9.0, 6.0, Material::concrete, Material::concrete), {}, 100.0);
  d.volumes[0].lining.roughness = 0.02;
  d.volumes[0].cap_begin = d.volumes[0].cap_end = false;
  const World world(d);
  double square = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < world.chunks().size(); ++i) {
    const Mesh mesh = world.build_mesh(i);
    for (const MeshVertex& v : mesh.vertices) {
      const Eigen::Vector3d p = v.position + world.chunks()[i].bounds.center();
      if (p.z() < 0.5 || p.z() > 5.5) continue;
      const double height = 4.5 - std::abs(p.y());
      square += height * height;
      ++n;
    }
  }
  EXPECT_NEAR(std::sqrt(square / n), 0.5 * 0.02, 0.15 * 0.01);  // box walls carry half of the lining's roughness
}

TEST(LiningTexture, FootprintsAverage) {
  WorldDescription d = plain_tube(road_profile({}, Material::concrete), {}, 20.0);
  d.texture = 1;
  const World world(d);
  const LiningTexture texture(d, world.chunks()[0], true);
  double fine = 0.0, coarse = 0.0, mean_fine = 0.0, mean_coarse = 0.0;
  int n = 0;
  for (float s = 1.0F; s < 19.0F; s += 0.037F) {
    for (float u = 12.0F; u < 20.0F; u += 0.31F) {
      const double a = texture.temperature(s, u, std::log2(0.01F), std::log2(0.01F));
      const double b = texture.temperature(s, u, std::log2(0.8F), std::log2(0.2F));
      fine += a * a;
      coarse += b * b;
      mean_fine += a;
      mean_coarse += b;
      ++n;
    }
  }
  EXPECT_LT(coarse, fine);
  EXPECT_GT(coarse, 0.3 * fine);  // most of a 1/f field is coarse
  EXPECT_NEAR(mean_coarse / n, mean_fine / n, 0.01);
  EXPECT_NEAR(std::sqrt(fine / n), 0.1, 0.06);
}

TEST(LiningTexture, IsContinuousAcrossChunks) {
  WorldDescription d = plain_tube(road_profile({}, Material::concrete), {}, 40.0);
  d.texture = 1;
  const World world(d);
  ASSERT_EQ(world.chunks().size(), 2U);
  const LiningTexture a(d, world.chunks()[0], true);
  const LiningTexture b(d, world.chunks()[1], true);
  for (float u = 1.0F; u < 25.0F; u += 0.21F) {
    EXPECT_NEAR(a.temperature(20.0F, u, std::log2(0.02F), std::log2(0.02F)),
                b.temperature(0.0F, u, std::log2(0.02F), std::log2(0.02F)), 0.02);
    EXPECT_NEAR(a.temperature(20.0F, u, std::log2(0.3F), std::log2(0.1F)),
                b.temperature(0.0F, u, std::log2(0.3F), std::log2(0.1F)), 0.02);
  }
}

TEST(Atmosphere, DepthIsExtinctionTimesPath) {
  Atmosphere a;
  SmokeBox box;
  box.pose.linear() = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  box.pose.translation() = Eigen::Vector3d(10.0, 5.0, 0.0);
  box.half_size = {3.0, 2.0, 2.0};
  box.extinction = extinction(Obscurant::soot, 4.0);
  a.add(box);
  EXPECT_NEAR(box.extinction.lidar, 0.64 * 3.912 / 4.0, 1e-12);
  EXPECT_NEAR(box.extinction.thermal, 0.04 * 3.912 / 4.0, 1e-12);
  const Eigen::Vector3d along = box.pose.linear().col(0);
  const Eigen::Vector3d from = box.pose.translation() - 8.0 * along;
  EXPECT_NEAR(a.depth(from, along, 4.0).lidar, 0.0, 1e-12);                           // not there yet
  EXPECT_NEAR(a.depth(from, along, 7.0).lidar, 2.0 * box.extinction.lidar, 1e-12);    // 5 .. 7
  EXPECT_NEAR(a.depth(from, along, 100.0).lidar, 6.0 * box.extinction.lidar, 1e-12);  // through
  EXPECT_NEAR(a.depth(box.pose.translation(), along, 100.0).thermal, 3.0 * box.extinction.thermal, 1e-12);
  EXPECT_NEAR(a.depth(from, -along, 100.0).lidar, 0.0, 1e-12);
  EXPECT_NEAR(a.at(box.pose.translation()).lidar, box.extinction.lidar, 1e-12);
  EXPECT_NEAR(a.at(from).lidar, 0.0, 1e-12);
}

TEST(Atmosphere, RampsAlongATunnel) {
  const CenterLine line({}, {{300.0, 0.0, 0.0}});
  Atmosphere a;
  a.add_along(line, 100.0, 200.0, 20.0, Obscurant::fog, 10.0, 12.0, 7.0);
  // The density is a trapezium: 60 m full, two ramps of 20 m at half of it on average.
  EXPECT_NEAR(a.depth({0.0, 0.0, 2.0}, Eigen::Vector3d::UnitX(), 300.0).lidar, 80.0 * 0.3912, 0.01);
}

TEST(RandomWorld, LineIsDrawnFromSeedAndName) {
  const CenterLine a = random_line({}, 1500.0, 300.0, 0.03, 5, "main");
  const CenterLine same = random_line({}, 1500.0, 300.0, 0.03, 5, "main");
  const CenterLine other = random_line({}, 1500.0, 300.0, 0.03, 6, "main");
  EXPECT_NEAR(a.length(), 1500.0, 1e-9);
  EXPECT_EQ(a.at(1200.0).position, same.at(1200.0).position);
  EXPECT_GT((a.at(1200.0).position - other.at(1200.0).position).norm(), 5.0);
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const CenterLine line = random_line({}, 1500.0, 300.0, 0.03, seed, "main");
    double turned = 0.0;
    for (double s = 0.0; s < line.length(); s += 5.0) {
      const LinePoint p = line.at(s);
      EXPECT_LE(std::abs(p.curvature), 1.0 / 300.0 + 1e-12);
      EXPECT_LE(std::abs(p.grade), 0.03 + 1e-12);
      EXPECT_LE(std::abs(p.heading), std::numbers::pi / 3.0 + 0.01);
      turned = std::max(turned, std::abs(p.heading));
    }
    EXPECT_GT(turned, 0.02) << seed;
  }
}

TEST(RandomWorld, LayByOpensTheWallAndIsClosed) {
  WorldDescription description = plain_tube(box_profile(9.0, 6.0, Material::concrete, Material::concrete), {}, 200.0);
  description.volumes[0].kind = VolumeKind::road;
  description.volumes[0].equipment.lay_bys = 200.0;  // one, in the middle
  add_lay_bys(description);
  ASSERT_EQ(description.volumes.size(), 2U);
  const World world(description);
  RayCaster caster(world, {200.0, false, 1});
  const auto to_the_right = [&](double x) {
    const Eigen::Vector3d from(x, 0.0, 1.5);
    const Eigen::Vector3d direction(0.0, -1.0, 0.0);
    caster.look_from(from);
    RayPacket packet{};
    packet.far.fill(-1.0F);
    const Eigen::Vector3f start = (from - caster.origin()).cast<float>();
    packet.ox[0] = start.x();
    packet.oy[0] = start.y();
    packet.oz[0] = start.z();
    packet.dy[0] = -1.0F;
    packet.far[0] = 100.0F;
    caster.cast(packet);
    return packet.hit(0) ? caster.exact_range(packet, 0, from, direction) : -1.0;
  };
  EXPECT_NEAR(to_the_right(70.0), 4.5, 1e-6);
  EXPECT_NEAR(to_the_right(100.0), 7.5, 1e-6);
  EXPECT_NEAR(to_the_right(118.0), 7.5, 1e-6);
  EXPECT_NEAR(to_the_right(125.0), 4.5, 1e-6);
  EXPECT_LT(leak_share(world, {{100.0, -5.5, 1.5}, {95.0, 0.0, 1.5}, {119.0, -4.0, 2.0}}, 20000), 2e-5);
}

}  // namespace
}  // namespace adit::tunnel_simulator
