// Sends a rosbag2 bag again, topic by topic with the QoS it was recorded with, at its own pace or another.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/dataset/bag_reader.hpp"
#include "middleware/participant.hpp"

namespace adit {

struct PlayerConfig {
  ParticipantConfig participant;
  std::string bag;                           // folder or .db3 file
  std::vector<std::string> topics;           // as the bag names them; empty: all
  std::map<std::string, std::string> remap;  // name in the bag -> name it is sent under
  double rate = 1.0;                         // times real time, > 0
  double start_s = 0.0;                      // from the bag's first sample; >= 0
  std::optional<double> duration_s;          // of the bag's time
  bool loop = false;
  double clock_hz = 0.0;  // > 0: publishes the bag's time on /clock this often (a recorded /clock is left out)
};

// One thread calls it.
class Player {
 public:
  struct Counts {
    std::uint64_t sent = 0, bytes = 0;
    std::uint64_t refused = 0;  // by the middleware: a reliable reader that does not take them, out of memory
    Duration latest{};          // the most a sample was behind its time
  };
  // Whether to go on; called at least every 100 ms with how far the bag's time has come.
  using GoOn = std::function<bool(Duration since_start)>;

  // Creates the writers. Fails when the bag cannot be read, has none of the topics, or two get one name.
  static Result<std::unique_ptr<Player>> open(const PlayerConfig& config);
  ~Player();

  // Waits until discovery is at rest and every reader it found is matched, so that none misses the first sample; at
  // most `limit` for each of the two.
  void wait_for_readers(Duration limit);
  // Sends everything, or until `go_on` says no; for `loop`, over and over. Samples of latched topics from before the
  // start are sent first. At the end waits up to 2 s for reliable readers to have all of it.
  Result<void> run(const GoOn& go_on);

  const Counts& counts() const { return counts_; }
  // Of the bag's time, what will be played in one round.
  Duration length() const { return Duration(end_ns_ - begin_ns_); }

 private:
  struct Channel;
  class Clock;
  Player() = default;
  Result<void> add_channels();
  void send(const dataset::BagSample& sample);
  // One round; false: `go_on` said no.
  Result<bool> play(const GoOn& go_on);

  PlayerConfig config_;
  std::unique_ptr<Participant> participant_;
  std::unique_ptr<dataset::BagReader> bag_;
  std::vector<std::unique_ptr<Channel>> channels_;  // by the bag's topic index; null: not played
  std::vector<std::string> played_;                 // their names in the bag
  std::unique_ptr<Clock> clock_;
  std::int64_t begin_ns_ = 0, end_ns_ = 0;
  Counts counts_;
};

}  // namespace adit
