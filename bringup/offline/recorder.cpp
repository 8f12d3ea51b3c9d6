#include "bringup/offline/recorder.hpp"

#include <algorithm>

#include "components/dataset/bag_qos.hpp"

namespace adit::offline {

Result<std::size_t> Recorder::add(const std::string& topic, const TypeInfo& type) {
  dataset::BagTopic entry;
  entry.name = topic;
  entry.type = type.ros_name;
  entry.qos = dataset::bag_qos_text({dataset::BagQos{}});
  entry.type_hash = type.type_hash;
  entry.schema = type.schema;
  return writer_->add_topic(entry);
}

void Recorder::write(std::size_t topic, Time stamp, Bytes cdr) {
  if (state_) state_ = writer_->write({topic, stamp.time_since_epoch().count(), cdr});
}

Result<void> Recorder::open(const std::string& folder, OfflineRunner& runner, const std::vector<std::string>& topics) {
  auto writer = dataset::BagWriter::create(folder);
  if (!writer) return writer.error();
  writer_ = *std::move(writer);
  const std::vector<PortInfo> ports = runner.ports();
  for (const std::string& topic : topics) {
    const auto output = std::find_if(ports.begin(), ports.end(), [&](const PortInfo& port) {
      return port.direction == PortInfo::Direction::output && port.topic == topic;
    });
    if (output == ports.end()) {
      from_source_.push_back({topic});
      continue;
    }
    const Result<std::size_t> index = add(topic, *output->type);
    if (!index) return index.error();
    runner.tap_cdr(topic, [this, index = *index](Bytes cdr, Time stamp) { write(index, stamp, cdr); });
  }
  return {};
}

void Recorder::note(const OfflineMessage& message) {
  if (!state_ || !message.object) return;
  const auto topic = std::find_if(from_source_.begin(), from_source_.end(),
                                  [&](const SourceTopic& t) { return t.name == message.topic; });
  if (topic == from_source_.end()) return;
  if (!topic->known) {
    const Result<std::size_t> index = add(topic->name, *message.type->info);
    if (!index) {
      state_ = index.error();
      return;
    }
    topic->index = *index;
    topic->known = true;
  }
  buffer_.resize(message.type->encoded_size(message.object.get()));
  write(topic->index, message.stamp, Bytes(buffer_.data(), message.type->encode(message.object.get(), buffer_)));
}

Result<void> Recorder::close() {
  return !writer_ || !state_ ? state_ : writer_->close();
}

}  // namespace adit::offline
