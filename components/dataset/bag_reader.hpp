// Reads rosbag2 bags of SQLite files: database schemas 1 to 4 (ROS 2 Foxy and later), split ones too.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "components/dataset/bag.hpp"
#include "idl/result.hpp"

namespace adit::dataset {

struct BagInfo {
  std::vector<BagTopic> topics;
  std::vector<std::uint64_t> counts;  // samples by topic
  std::uint64_t samples = 0;
  std::int64_t first_ns = 0, last_ns = 0;  // stamps; 0 when there is no sample
};

// One thread. Never writes to the bag.
class BagReader {
 public:
  // A bag's folder (by its metadata.yaml; without one, all *.db3 in it by name) or one .db3 file. Errors: nothing
  // there, MCAP storage, compressed, not a database, not a bag.
  static Result<std::unique_ptr<BagReader>> open(const std::string& path);
  ~BagReader();

  const BagInfo& info() const;
  // Only these topics from here on (names that the bag does not have are ignored); none: all. Starts anew.
  Result<void> select(const std::vector<std::string>& names);
  // The next sample, in the order of the stamps within each file, files one after the other; false at the end. The
  // bytes are valid until the next call.
  Result<bool> next(BagSample& out);

 private:
  struct Impl;
  explicit BagReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace adit::dataset
