// What the deterministic runner is fed with: a simulated scenario, or recorded files.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "components/runtime/offline_runner.hpp"
#include "idl/result.hpp"
#include "middleware/time.hpp"

namespace adit::offline {

struct SourceOptions {
  double duration_s = 0.0;            // 0: all of it
  std::optional<std::uint64_t> seed;  // nothing: the scenario's own
  int threads = 1;                    // of the simulator; the data do not depend on it
  std::set<std::string> topics;       // somebody listens to; what nobody hears is not made
};

// An OfflineSource that knows how long it is.
class Source : public OfflineSource {
 public:
  virtual Time begin() const = 0;
  virtual Time end() const = 0;
};

// By what the path is: a scenario file (.yaml), a rosbag2 bag (its folder or .db3 file), or a folder of clouds
// (components/dataset). Errors name the path.
Result<std::unique_ptr<Source>> open_source(const std::string& path, const SourceOptions& options);

// The simulator, without its component: samples in the order of their arrival. Every topic of the sensors, and
// /ground_truth/odometry.
Result<std::unique_ptr<Source>> open_scenario(const std::string& path, const SourceOptions& options);

// A recording, its samples by the stamps of their arrival.
Result<std::unique_ptr<Source>> open_bag(const std::string& path, const SourceOptions& options);

// Clouds of a folder on /lidar/points; its gt_base.tum, when there is one, on /ground_truth/odometry.
Result<std::unique_ptr<Source>> open_folder(const std::string& path, const SourceOptions& options);

}  // namespace adit::offline
