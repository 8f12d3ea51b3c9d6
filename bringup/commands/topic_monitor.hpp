// Reads the serialized samples of one topic, whatever its type: what hz, bw, delay and echo are made of.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "middleware/participant.hpp"

namespace adit {

// The weakest request that still matches every one of these writers, and asks for history when all of them keep it.
Qos matching_qos(const std::vector<EndpointInfo>& writers);

// Whether messages of the type begin with a std_msgs/Header or a builtin_interfaces/Time, by its schema text.
bool begins_with_stamp(const TypeInfo& type);

// The header stamp of a serialized message: its first 8 bytes, seconds and nanoseconds, either endianness. Only
// meaningful where begins_with_stamp.
std::optional<Time> leading_stamp(Bytes cdr);

class TopicMonitor {
 public:
  // Joins, waits up to `discovery` for a writer of the topic and opens a reader that matches it. Fails with the list of
  // topics when there is none, and for a topic with several types.
  static Result<std::unique_ptr<TopicMonitor>> open(const ParticipantConfig& config, const std::string& topic,
                                                    Duration discovery);

  // Hands each sample to `handle` in order, on the calling thread, until it returns false, the time is over, or
  // SIGINT or SIGTERM arrives. Sleeps between samples.
  void run(std::optional<Duration> limit, const std::function<bool(const Sample&)>& handle);

  const std::string& type() const { return type_; }  // ROS name
  LinkStats stats() const { return reader_->stats(); }

 private:
  TopicMonitor() = default;

  std::string type_, dds_type_, hash_;
  TypeInfo info_{};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool ready_ = false;
  std::unique_ptr<Participant> participant_;
  std::unique_ptr<Reader> reader_;
};

}  // namespace adit
