// Messages of a run on some topics, as a bag: sensors and truth from the source, odometries from the components, so
// that the filters can be run again on them without rendering anything.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "components/dataset/bag_writer.hpp"
#include "components/runtime/offline_runner.hpp"

namespace adit::offline {

class Recorder {
 public:
  // Creates the bag and listens to the runner's components; before the run.
  Result<void> open(const std::string& folder, OfflineRunner& runner, const std::vector<std::string>& topics);
  // A message of the source. Only those that come as objects, from the simulator: what a bag or a folder gives is there
  // already.
  void note(const OfflineMessage& message);
  // The first thing that went wrong since open().
  Result<void> close();

 private:
  Result<std::size_t> add(const std::string& topic, const TypeInfo& type);
  void write(std::size_t topic, Time stamp, Bytes cdr);

  struct SourceTopic {
    std::string name;
    std::size_t index = 0;
    bool known = false;  // its type, from its first message
  };
  std::unique_ptr<dataset::BagWriter> writer_;
  std::vector<SourceTopic> from_source_;
  std::vector<std::byte> buffer_;
  Result<void> state_;
};

}  // namespace adit::offline
