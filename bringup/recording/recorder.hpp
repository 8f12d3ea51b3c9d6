// Writes what a domain says into a rosbag2 bag.
#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "components/dataset/bag_writer.hpp"
#include "middleware/participant.hpp"

namespace adit {

struct RecorderConfig {
  ParticipantConfig participant;
  std::string folder;               // of the bag; one of the same name in it is replaced
  std::vector<std::string> topics;  // empty: every ROS topic, also those that appear later
};

// One thread calls it. Types need not be built in: only their names and hashes are used.
class Recorder {
 public:
  struct TopicState {
    std::string name, type;  // type is empty while nobody has written the topic
    std::uint64_t samples = 0, bytes = 0;
    std::uint64_t lost = 0;  // on the way, or overwritten before they were taken
    std::string problem;     // why something of it is not recorded; empty: all is well
  };

  static Result<std::unique_ptr<Recorder>> open(const RecorderConfig& config);
  ~Recorder();

  // Waits at most `limit` for samples and stores those that are there. Looks twice a second for new topics and writers
  // and commits once a second. Fails when the bag cannot be written (disk full): what was committed stays.
  Result<void> step(Duration limit);
  // Stores what has arrived and ends the bag.
  Result<void> close();

  // In the order they were found; wanted ones that never appeared too.
  std::vector<TopicState> topics() const;

 private:
  struct Subscription;
  Recorder(RecorderConfig config, std::unique_ptr<Participant> participant, std::unique_ptr<dataset::BagWriter> writer);
  void look();
  void follow(const std::string& topic, const std::vector<EndpointInfo>& writers);
  void subscribe(Subscription& subscription);
  // Stores at most a fixed number of samples of one topic, so that a flood of it does not starve the others; true:
  // there may be more.
  Result<bool> drain(Subscription& subscription);
  Result<bool> drain_all();
  Result<void> commit_when_due();

  RecorderConfig config_;
  std::unique_ptr<Participant> participant_;
  std::unique_ptr<dataset::BagWriter> writer_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::chrono::steady_clock::time_point next_look_{}, next_commit_{};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool ready_ = false;  // under mutex_: samples may be there
};

}  // namespace adit
