#include "components/tunnel_simulator/mesh_import.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "components/tunnel_simulator/ray_caster.hpp"

namespace adit::tunnel_simulator {
namespace {

class MeshImport : public ::testing::Test {
 protected:
  std::filesystem::path file_ = std::filesystem::temp_directory_path() / ("adit_mesh_" + std::to_string(::getpid()));
  void TearDown() override { std::filesystem::remove(file_); }
  Result<Mesh> load(const std::string& content) {
    std::ofstream(file_, std::ios::binary) << content;
    return import_mesh(file_.string());
  }
};

TEST_F(MeshImport, PlyFaces) {
  const auto mesh = load(
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n");
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->vertices.size(), 4U);
  EXPECT_EQ(mesh->triangles.size(), 2U);
}

TEST_F(MeshImport, BinaryPcdBecomesAClosedWall) {
  std::string content =
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 6561\nHEIGHT "
      "1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 6561\nDATA binary\n";
  for (int i = 0; i < 81; ++i) {
    for (int j = 0; j < 81; ++j) {
      const float p[4] = {5.0F, -4.0F + 0.1F * static_cast<float>(i), -4.0F + 0.1F * static_cast<float>(j), 1.0F};
      content.append(reinterpret_cast<const char*>(p), sizeof p);
    }
  }
  auto mesh = load(content);
  ASSERT_TRUE(mesh) << mesh.error().message;
  WorldDescription description;
  const World world(description, std::move(*mesh));
  RayCaster caster(world, {});
  caster.look_from({0.0, 0.0, 0.0});
  for (int k = 0; k < 100; ++k) {
    RayPacket packet;
    packet.time.fill(0.0F);
    packet.ox.fill(static_cast<float>(-caster.origin().x()));
    packet.oy.fill(static_cast<float>(-caster.origin().y()));
    packet.oz.fill(static_cast<float>(-caster.origin().z()));
    packet.far.fill(100.0F);
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      const Eigen::Vector3d d =
          Eigen::Vector3d(1.0, -0.6 + 0.012 * k, -0.6 + 0.075 * static_cast<double>(lane)).normalized();
      packet.dx[lane] = static_cast<float>(d.x());
      packet.dy[lane] = static_cast<float>(d.y());
      packet.dz[lane] = static_cast<float>(d.z());
    }
    caster.cast(packet);
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      ASSERT_TRUE(packet.hit(lane)) << k << ' ' << lane;
      EXPECT_NEAR(packet.far[lane] * packet.dx[lane], 5.0F, 1e-4F);
    }
  }
}

TEST_F(MeshImport, MalformedFilesAreRefused) {
  EXPECT_FALSE(import_mesh("/nowhere.ply"));
  for (const char* content :
       {"", "hello\n", "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n",
        "ply\nformat binary_big_endian 1.0\nend_header\n", "ply\nelement vertex -3\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face "
        "1\nproperty list uchar int "
        "v\nend_header\n0 0 0\n3 0 1 2\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
        "z\nend_header\nnan 0 0\n",
        "VERSION 0.7\nFIELDS x y z\nSIZE 3 4 4\nTYPE F F F\nPOINTS 1\nDATA binary\nabcdefghijkl",
        "VERSION 0.7\nFIELDS x y z\nDATA binary_compressed\n"}) {
    EXPECT_FALSE(load(content)) << content;
  }
}

}  // namespace
}  // namespace adit::tunnel_simulator
