// The dependency law, read from the #include lines of the source tree.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

// What every component may include besides itself: the runtime, and plain libraries that know neither it nor
// middleware.
const std::set<std::string> plain_libraries = {"geometry", "config", "dataset", "pose_graph"};
// Components whose algorithm is a library of its own: only the adapter (a file named *component*) knows the framework.
const std::set<std::string> algorithm_folders = {"lidar_odometry", "mapping", "thermal_odometry", "state_estimator",
                                                 "tunnel_simulator"};

bool starts_with_any(const std::string& text, std::initializer_list<const char*> prefixes) {
  return std::any_of(prefixes.begin(), prefixes.end(), [&](const char* prefix) { return text.starts_with(prefix); });
}

// "components/lidar_odometry/x.hpp" -> "lidar_odometry"; empty outside components/.
std::string component_of(const std::string& path) {
  const std::string top = "components/";
  if (!path.starts_with(top)) return "";
  return path.substr(top.size(), path.find('/', top.size()) - top.size());
}

int layer_of(const std::string& path) {
  if (path.starts_with("idl/")) return 0;
  if (path.starts_with("middleware/")) return 1;
  if (path.starts_with("components/")) {
    const std::string component = component_of(path);
    if (plain_libraries.contains(component)) return 0;
    return component == "runtime" ? 2 : 3;
  }
  if (path.starts_with("bringup/")) return 4;
  if (path.starts_with("tests/")) return 5;
  return -1;  // not ours
}

bool is_test(const std::string& file) {
  return file.starts_with("tests/") || file.find("_test.") != std::string::npos;
}

struct Include {
  std::string header;
  bool quoted = true;
  int line = 0;
};

// Why `file` must not include the header; empty when it may.
std::string violation(const std::string& file, const Include& include) {
  const std::string& header = include.header;
  const int from = layer_of(file);
  const int to = include.quoted ? layer_of(header) : -1;  // <idl/...> is idlc's, "idl/..." is ours
  const std::string component = component_of(file);
  if (to >= 0) {
    if (to > from) return "includes a higher layer";
    const std::string other = component_of(header);
    const bool shared = other.empty() || other == "runtime" || plain_libraries.contains(other);
    if (!component.empty() && component != other && !shared) return "a component includes another component";
    const bool framework = header.starts_with("middleware/") || other == "runtime";
    if (plain_libraries.contains(component) && framework) return "a plain library includes the framework";
    const bool adapter = file.find("component", std::string("components/").size()) != std::string::npos;
    if (algorithm_folders.contains(component) && framework && !adapter && !is_test(file)) {
      return "an algorithm includes the framework: only the adapter may";
    }
    if (header.starts_with("middleware/fastdds/") && !file.starts_with("middleware/fastdds/") && !is_test(file)) {
      return "reaches into a vendor's folder";
    }
    if (header.starts_with("middleware/cyclonedds/") && !file.starts_with("middleware/cyclonedds/") && !is_test(file)) {
      return "reaches into a vendor's folder";
    }
    return "";
  }
  const auto only_in = [&](std::initializer_list<const char*> places) { return starts_with_any(file, places); };
  const bool in_header = file.ends_with(".hpp");
  if (header.starts_with("fastcdr/") && !only_in({"idl/", "tests/"})) return "Fast CDR is known to idl/ only";
  // Bare vendor programs are what benchmarks compare with.
  if (starts_with_any(header, {"fastdds/", "fastrtps/"}) &&
      !only_in({"middleware/fastdds/", "tests/", "bringup/bench"})) {
    return "Fast DDS is known to middleware/fastdds/ only";
  }
  if (starts_with_any(header, {"dds/", "iceoryx"}) && !only_in({"middleware/cyclonedds/", "tests/", "bringup/bench"})) {
    return "Cyclone DDS is known to middleware/cyclonedds/ only";
  }
  if (starts_with_any(header, {"idl/", "idlc/"}) && !only_in({"idl/generator/"})) {
    return "idlc is known to idl/generator/ only";
  }
  if (header.starts_with("embree") && !only_in({"components/tunnel_simulator/"})) {
    return "Embree is known to components/tunnel_simulator/ only";
  }
  if (starts_with_any(header, {"pcl/", "opencv2/", "ceres/", "embree"}) && in_header) {
    return "heavy header in a header";
  }
  // Reading and writing of files is for tools; pcl_io would also bring VTK.
  const bool off_board = only_in(
      {"components/dataset/", "components/dataset_player/", "components/tunnel_simulator/", "bringup/", "tests/"});
  if (starts_with_any(header, {"pcl/io/", "opencv2/imgcodecs", "opencv2/highgui", "opencv2/opencv.hpp"}) &&
      !off_board && !is_test(file)) {
    return "file formats in an on-board library";
  }
  return "";
}

std::vector<Include> includes_of(const fs::path& path) {
  static const std::regex pattern(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"].*)");
  std::vector<Include> includes;
  std::ifstream file(path);
  int number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    std::smatch match;
    if (std::regex_match(line, match, pattern)) includes.push_back({match[2], match[1] == "\"", number});
  }
  return includes;
}

TEST(Architecture, RulesRefuseWhatTheyShould) {
  const auto refused = [](const char* file, const char* header, bool quoted = true) {
    return violation(file, {header, quoted}) != "";
  };
  EXPECT_TRUE(refused("idl/codec.hpp", "middleware/qos.hpp"));
  EXPECT_TRUE(refused("middleware/sample.cpp", "components/runtime/component.hpp"));
  EXPECT_TRUE(refused("components/runtime/clock.cpp", "bringup/run.hpp"));
  EXPECT_TRUE(refused("components/runtime/clock.cpp", "components/lidar_odometry/voxel_map.hpp"));
  EXPECT_TRUE(refused("components/lidar_odometry/odometry.cpp", "components/thermal_odometry/tracker.hpp"));
  EXPECT_TRUE(refused("components/lidar_odometry/odometry.cpp", "components/runtime/clock.hpp"));
  EXPECT_TRUE(refused("components/geometry/se3.cpp", "components/runtime/clock.hpp"));
  EXPECT_TRUE(refused("components/runtime/port.hpp", "middleware/fastdds/writer.hpp"));
  EXPECT_TRUE(refused("middleware/cyclonedds/writer.cpp", "fastdds/dds/topic/TypeSupport.hpp"));
  EXPECT_TRUE(refused("middleware/fastdds/writer.cpp", "dds/dds.h"));
  EXPECT_TRUE(refused("middleware/sample.cpp", "fastcdr/Cdr.h"));
  EXPECT_TRUE(refused("components/lidar_odometry/component.cpp", "embree3/rtcore.h"));
  EXPECT_TRUE(refused("components/lidar_odometry/icp.cpp", "pcl/io/pcd_io.h"));
  EXPECT_TRUE(refused("components/lidar_odometry/icp.hpp", "pcl/point_types.h"));
  EXPECT_TRUE(refused("idl/codec.cpp", "idl/processor.h", false));
  EXPECT_TRUE(refused("idl/codec.cpp", "idlc/generator.h", false));

  EXPECT_FALSE(refused("idl/generator/syntax_tree.c", "idl/processor.h", false));
  EXPECT_FALSE(refused("components/lidar_odometry/lidar_odometry_component.cpp", "components/runtime/component.hpp"));
  EXPECT_FALSE(refused("components/lidar_odometry/icp.cpp", "components/geometry/se3.hpp"));
  EXPECT_FALSE(refused("components/lidar_odometry/icp.cpp", "idl/result.hpp"));
  EXPECT_FALSE(refused("bringup/main.cpp", "components/runtime/component.hpp"));
  EXPECT_FALSE(refused("components/tunnel_simulator/caster.cpp", "embree3/rtcore.h"));
  EXPECT_FALSE(refused("components/lidar_odometry/icp.cpp", "vector"));
}

TEST(Architecture, EveryIncludeObeysTheDependencyLaw) {
  const fs::path root = ADIT_SOURCE_DIR;
  int files = 0, includes = 0;
  for (const char* top : {"idl", "middleware", "components", "bringup", "tests"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string extension = entry.path().extension();
      if (extension != ".hpp" && extension != ".cpp" && extension != ".h" && extension != ".c") continue;
      const std::string file = entry.path().lexically_relative(root).generic_string();
      ++files;
      for (const Include& include : includes_of(entry.path())) {
        ++includes;
        EXPECT_EQ(violation(file, include), "") << file << ':' << include.line << ": " << include.header;
        if (include.quoted && layer_of(include.header) >= 0) {
          EXPECT_TRUE(fs::exists(root / include.header)) << file << ':' << include.line << ": " << include.header;
        }
      }
    }
  }
  std::cout << includes << " includes of " << files << " files\n";
  EXPECT_GT(files, 100);
}

}  // namespace
