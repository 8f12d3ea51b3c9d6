#include "bringup/recording/player.hpp"

#include <algorithm>
#include <cmath>
#include <thread>

#include "bringup/commands/graph_table.hpp"
#include "components/dataset/bag_qos.hpp"
#include "idl/type_registry.hpp"
#include "rosgraph_msgs/msg/clock.hpp"

namespace adit {
namespace {

using Steady = std::chrono::steady_clock;
constexpr auto kAskEvery = std::chrono::milliseconds(100);
constexpr auto kAcknowledgementLimit = std::chrono::seconds(2);
constexpr const char* kNode = "/adit_play";

// "sensor_msgs/msg/PointCloud2" -> "sensor_msgs::msg::dds_::PointCloud2_"; empty when it is not of that form.
std::string dds_type_of(const std::string& ros_type) {
  const std::size_t first = ros_type.find('/');
  const std::size_t last = ros_type.rfind('/');
  if (first == std::string::npos || first == last) return "";
  return ros_type.substr(0, first) + "::" + ros_type.substr(first + 1, last - first - 1) +
         "::dds_::" + ros_type.substr(last + 1) + "_";
}

}  // namespace

struct Player::Channel {
  std::string ros_type, dds_type, hash;
  TypeInfo type{};  // refers to the strings above
  bool latched = false;
  std::unique_ptr<Writer> writer;
};

// The bag's time on /clock.
class Player::Clock {
 public:
  static Result<std::unique_ptr<Clock>> open(Participant& participant, double hz) {
    std::unique_ptr<Clock> clock(new Clock(hz));
    EndpointConfig endpoint;
    endpoint.topic = "/clock";
    endpoint.type = &type_info<rosgraph_msgs::msg::Clock>();
    endpoint.qos = Qos::clock();
    endpoint.node = kNode;
    Result<std::unique_ptr<Writer>> writer = participant.writer(endpoint);
    if (!writer) return writer.error();
    clock->writer_ = *std::move(writer);
    return clock;
  }
  // In the bag's time, from one /clock message to the next.
  std::int64_t period_ns(double rate) const { return std::llround(1e9 * rate / hz_); }
  void publish(std::int64_t bag_ns) {
    message_.clock.sec = static_cast<std::int32_t>(bag_ns / 1'000'000'000);
    message_.clock.nanosec = static_cast<std::uint32_t>(bag_ns % 1'000'000'000);
    (void)writer_->publish(MessageEncoder(message_));
  }

 private:
  explicit Clock(double hz) : hz_(hz) {}
  double hz_;
  rosgraph_msgs::msg::Clock message_;
  std::unique_ptr<Writer> writer_;
};

Player::~Player() = default;

Result<std::unique_ptr<Player>> Player::open(const PlayerConfig& config) {
  if (!(config.rate > 0.0) || !(config.start_s >= 0.0) || !(config.clock_hz >= 0.0)) {
    return Error{ErrorCode::invalid_argument, "rate must be above 0, start and clock rate not below 0"};
  }
  auto bag = dataset::BagReader::open(config.bag);
  if (!bag) return bag.error();
  std::unique_ptr<Player> player(new Player);
  player->config_ = config;
  player->bag_ = *std::move(bag);
  const dataset::BagInfo& info = player->bag_->info();
  player->begin_ns_ = info.first_ns + std::llround(config.start_s * 1e9);
  player->end_ns_ = info.last_ns;
  if (config.duration_s) {
    player->end_ns_ =
        std::min<std::int64_t>(player->end_ns_, player->begin_ns_ + std::llround(*config.duration_s * 1e9));
  }
  if (info.samples == 0 || player->begin_ns_ > player->end_ns_) {
    return Error{ErrorCode::invalid_argument,
                 config.bag + ": nothing to play: " + std::to_string(info.samples) + " samples over " +
                     std::to_string(static_cast<double>(info.last_ns - info.first_ns) * 1e-9) + " s"};
  }
  Result<std::unique_ptr<Participant>> participant = adit::open(config.participant);
  if (!participant) return participant.error();
  player->participant_ = *std::move(participant);
  if (Result<void> added = player->add_channels(); !added) return added.error();
  return player;
}

Result<void> Player::add_channels() {
  const std::vector<dataset::BagTopic>& topics = bag_->info().topics;
  for (const std::string& wanted : config_.topics) {
    if (std::ranges::none_of(topics, [&](const auto& topic) { return topic.name == wanted; })) {
      return Error{ErrorCode::not_found, config_.bag + ": the bag has no topic " + wanted};
    }
  }
  std::map<std::string, std::string> names;  // sent under -> in the bag
  channels_.resize(topics.size());
  for (std::size_t i = 0; i < topics.size(); ++i) {
    const dataset::BagTopic& topic = topics[i];
    if (!config_.topics.empty() && std::ranges::count(config_.topics, topic.name) == 0) continue;
    if (config_.clock_hz > 0.0 && topic.name == "/clock") continue;
    auto channel = std::make_unique<Channel>();
    channel->ros_type = topic.type;
    channel->dds_type = dds_type_of(topic.type);
    const MessageType* const known = find_type(topic.type);
    // Bags up to Humble do not say the hash; of a type that is built in it is known.
    channel->hash = topic.type_hash.empty() && known ? std::string(known->info->type_hash) : topic.type_hash;
    channel->type = {channel->ros_type, channel->dds_type, channel->hash, topic.schema,
                     known ? known->info->typical_size : std::size_t{1024}};
    const Result<dataset::BagQos> recorded = dataset::bag_qos_offer(topic.qos);
    if (!recorded) return Error{recorded.error().code, topic.name + ": " + recorded.error().message};
    const auto renamed = config_.remap.find(topic.name);
    EndpointConfig endpoint;
    endpoint.topic = renamed == config_.remap.end() ? topic.name : renamed->second;
    endpoint.type = &channel->type;
    endpoint.qos = Qos::reliable(recorded->depth);
    if (!recorded->reliable) endpoint.qos.reliability = Qos::Reliability::best_effort;
    if (recorded->transient_local) endpoint.qos.durability = Qos::Durability::transient_local;
    endpoint.node = kNode;
    if (!names.emplace(endpoint.topic, topic.name).second) {
      return Error{ErrorCode::invalid_argument,
                   topic.name + " and " + names[endpoint.topic] + " would both be sent as " + endpoint.topic};
    }
    channel->latched = recorded->transient_local;
    Result<std::unique_ptr<Writer>> writer = participant_->writer(endpoint);
    if (!writer) return Error{writer.error().code, endpoint.topic + ": " + writer.error().message};
    channel->writer = *std::move(writer);
    channels_[i] = std::move(channel);
    played_.push_back(topic.name);
  }
  if (played_.empty()) return Error{ErrorCode::invalid_argument, config_.bag + ": no topic is left to play"};
  if (config_.clock_hz > 0.0) {
    Result<std::unique_ptr<Clock>> clock = Clock::open(*participant_, config_.clock_hz);
    if (!clock) return clock.error();
    clock_ = *std::move(clock);
  }
  return {};
}

void Player::wait_for_readers(Duration limit) {
  const Graph graph = settled_graph(*participant_, limit);
  const auto all_matched = [&] {
    return std::ranges::all_of(channels_, [&](const auto& channel) {
      if (!channel) return true;
      const EndpointConfig& ours = channel->writer->config();
      const auto readers = std::ranges::count_if(graph.endpoints, [&](const EndpointInfo& other) {
        return !other.is_writer && other.topic == ours.topic && other.dds_type == channel->dds_type &&
               check(ours.qos, other.qos).empty();
      });
      return channel->writer->stats().matched >= static_cast<std::uint32_t>(readers);
    });
  };
  const auto end = Steady::now() + limit;
  while (!all_matched() && Steady::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(5));
}

void Player::send(const dataset::BagSample& sample) {
  if (Result<void> sent = channels_[sample.topic]->writer->forward(sample.cdr); !sent) {
    ++counts_.refused;
    return;
  }
  ++counts_.sent;
  counts_.bytes += sample.cdr.size();
}

Result<bool> Player::play(const GoOn& go_on) {
  const Steady::time_point start = Steady::now();
  const auto due = [&](std::int64_t bag_ns) {
    return start + Duration(std::llround(static_cast<double>(bag_ns - begin_ns_) / config_.rate));
  };
  std::int64_t clock_ns = begin_ns_;  // the next /clock message's
  // Waits until the sample's time, with /clock going on; false: `go_on` said no.
  const auto wait_for = [&](std::int64_t sample_ns) {
    while (true) {
      const bool clock_first = clock_ && clock_ns <= sample_ns;
      const Steady::time_point next = due(clock_first ? clock_ns : sample_ns);
      const Steady::time_point now = Steady::now();
      if (now >= next && !clock_first) return true;
      if (now >= next) {
        clock_->publish(clock_ns);
        clock_ns += std::max<std::int64_t>(1, clock_->period_ns(config_.rate));
        continue;
      }
      std::this_thread::sleep_until(std::min(next, now + kAskEvery));
      const double since = static_cast<double>((Steady::now() - start).count()) * config_.rate;
      if (!go_on(Duration(std::llround(since)))) return false;
    }
  };
  dataset::BagSample sample;
  Steady::time_point asked = start;
  while (true) {
    const Result<bool> there = bag_->next(sample);
    if (!there) return there.error();
    if (!*there) return true;
    if (sample.stamp_ns > end_ns_) continue;  // of a bag in several files a later one may still have earlier samples
    if (sample.stamp_ns < begin_ns_) {
      if (channels_[sample.topic]->latched) send(sample);
      continue;
    }
    if (!wait_for(sample.stamp_ns)) return false;
    const Steady::time_point now = Steady::now();
    counts_.latest = std::max(counts_.latest, Duration(now - due(sample.stamp_ns)));
    send(sample);
    // A bag that cannot be read as fast as it should be played never waits: ask here too.
    if (now - asked > kAskEvery) {
      asked = now;
      if (!go_on(Duration(sample.stamp_ns - begin_ns_))) return false;
    }
  }
}

Result<void> Player::run(const GoOn& go_on) {
  bool again = true;
  while (again) {
    if (Result<void> from_start = bag_->select(played_); !from_start) return from_start;
    const Result<bool> whole = play(go_on);
    if (!whole) return whole.error();
    again = *whole && config_.loop;
  }
  const auto limit = Steady::now() + kAcknowledgementLimit;
  for (const auto& channel : channels_) {
    if (!channel || channel->writer->config().qos.reliability != Qos::Reliability::reliable) continue;
    const Duration left = std::max(Duration(limit - Steady::now()), Duration(std::chrono::milliseconds(1)));
    if (Result<void> done = channel->writer->wait_for_acknowledgements(left); !done) return done;
  }
  return {};
}

}  // namespace adit
