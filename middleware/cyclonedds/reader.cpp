#include <dds/dds.h>

#include "middleware/cyclonedds/participant.hpp"
#include "middleware/cyclonedds/qos_mapping.hpp"
#include "middleware/cyclonedds/sample_cache.hpp"

namespace adit::cyclonedds {
namespace {

class CycloneReader final : public Reader {
 public:
  CycloneReader(ParticipantState& state, const EndpointConfig& config)
      : state_(state),
        config_(config),
        watch_(state, config_, false),
        cache_(std::make_shared<SampleCache>(
            config.qos.depth, [this](const Gid& writer, std::uint64_t count) { watch_.lost(gid_, writer, count); })) {}
  ~CycloneReader() override {
    if (reader_ <= 0) return;
    dds_delete(reader_);
    state_.close_topic(config_.topic);
  }

  Result<void> open() {
    const ddsi_sertype* type = nullptr;
    auto topic = state_.open_topic(config_, type);
    if (!topic) return topic.error();
    if (config_.qos.deadline) cache_->watch_deadline(*config_.qos.deadline, [this] { watch_.deadline_missed(gid_); });
    const auto listener = watch_.make_listener();
    const QosPointer qos = reader_qos(config_);
    dds_rhc* const history = SampleCache::make_history_cache(cache_);
    reader_ = dds_create_reader_rhc(state_.participant, *topic, qos.get(), listener.get(), history);
    dds_delete(*topic);
    if (reader_ < 0) {
      dds_rhc_free(history);
      state_.close_topic(config_.topic);
      return to_error(reader_, "reader of " + config_.topic);
    }
    gid_ = gid_of(reader_);
    watch_.created(reader_);
    return {};
  }

  std::size_t take(std::span<Sample> out) override { return cache_->take(out); }
  void on_data(Notify notify) override { cache_->on_data(std::move(notify)); }
  LinkStats stats() const override {
    LinkStats stats = cache_->stats();
    stats.matched = watch_.matched();
    return stats;
  }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  ParticipantState& state_;
  const EndpointConfig config_;
  EndpointWatch watch_;
  std::shared_ptr<SampleCache> cache_;
  dds_entity_t reader_ = 0;
  Gid gid_;
};

}  // namespace

Result<std::unique_ptr<Reader>> make_reader(ParticipantState& state, const EndpointConfig& config) {
  auto reader = std::make_unique<CycloneReader>(state, config);
  if (auto opened = reader->open(); !opened) return opened.error();
  return std::unique_ptr<Reader>(std::move(reader));
}

}  // namespace adit::cyclonedds
