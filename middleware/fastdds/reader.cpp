#include "middleware/fastdds/reader.hpp"

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

namespace adit::fastdds {
namespace {

std::uint64_t sequence_of(const dds::SampleInfo& info) {
  return info.sample_identity.sequence_number().to64long();
}

}  // namespace

const KeepAliveOperations LoaningReader::keep_alive_operations = {
    [](void* handle) noexcept { static_cast<Loan*>(handle)->references.fetch_add(1, std::memory_order_relaxed); },
    [](void* handle) noexcept {
      auto* loan = static_cast<Loan*>(handle);
      if (loan->references.fetch_sub(1, std::memory_order_acq_rel) > 1) return;
      LoaningReader* owner = loan->owner;
      owner->give_back(loan);
      {
        const std::lock_guard lock(owner->mutex_);
        --owner->outstanding_;
      }
      owner->release_reference();
    }};

LoaningReader::LoaningReader(std::shared_ptr<VendorParticipant> participant, const EndpointConfig& config)
    : participant_(std::move(participant)), config_(config), keep_all_(config.qos.depth == 0) {
  queue_.resize(keep_all_ ? keep_all_limit(*config_.type) : config_.qos.depth);
}

Result<LoaningReader*> LoaningReader::create(std::shared_ptr<VendorParticipant> participant,
                                             const EndpointConfig& config) {
  struct Release {
    void operator()(LoaningReader* unfinished) const { unfinished->release_reference(); }
  };
  std::unique_ptr<LoaningReader, Release> reader(new LoaningReader(std::move(participant), config));
  auto& owner = *reader->participant_;
  const auto topic = owner.acquire_topic(config.topic, *config.type);
  if (!topic) return topic.error();
  reader->has_topic_ = true;
  reader->reader_ =
      owner.subscriber().create_datareader(*topic, reader_qos(config), reader.get(), dds::StatusMask::all());
  if (!reader->reader_ || reader->reader_->enable() != ReturnCode_t::RETCODE_OK) {
    return Error{ErrorCode::invalid_argument,
                 "Fast DDS refuses a reader of '" + config.topic + "' with QoS " + to_string(config.qos)};
  }
  reader->gid_ = to_gid(reader->reader_->guid());
  owner.add_endpoint(config, reader->gid_, false);
  return reader.release();
}

LoaningReader::~LoaningReader() {
  close();
  if (reader_) participant_->subscriber().delete_datareader(reader_);
  if (has_topic_) participant_->release_topic(config_.topic);
}

void LoaningReader::release_reference() {
  if (references_.fetch_sub(1, std::memory_order_acq_rel) == 1) delete this;
}

void LoaningReader::close() {
  if (closed_.exchange(true)) return;
  on_data(nullptr);
  participant_->remove_endpoint(gid_);
  while (true) {
    Loan* loan = nullptr;
    {
      const std::lock_guard lock(mutex_);
      if (waiting_ == 0) break;
      loan = queue_[first_];
      first_ = (first_ + 1) % queue_.size();
      --waiting_;
    }
    give_back(loan);
  }
}

std::size_t LoaningReader::take(std::span<Sample> out) {
  std::size_t taken = 0;
  const std::size_t limit = outstanding_limit(config_.qos);
  while (taken < out.size()) {
    out[taken].reset();  // may give back a loan of this very reader
    Loan* loan = nullptr;
    bool more = false;
    {
      const std::lock_guard lock(mutex_);
      if (waiting_ > 0 && outstanding_ < limit) {
        loan = queue_[first_];
        first_ = (first_ + 1) % queue_.size();
        --waiting_;
        ++outstanding_;
      }
      more = std::exchange(vendor_has_more_, false);
    }
    if (more) drain();
    if (!loan) {
      if (more) continue;
      break;
    }
    references_.fetch_add(1, std::memory_order_relaxed);
    loan->references.store(1, std::memory_order_relaxed);
    Sample sample(loan->bytes, loan->info, KeepAlive(&keep_alive_operations, loan));
    if (config_.qos.lifespan && system_now() - loan->info.source_time > *config_.qos.lifespan) {
      rejected_.fetch_add(1, std::memory_order_relaxed);
      continue;
    }
    received_.fetch_add(1, std::memory_order_relaxed);
    received_bytes_.fetch_add(loan->bytes.size(), std::memory_order_relaxed);
    out[taken++] = std::move(sample);
  }
  return taken;
}

void LoaningReader::on_data(Reader::Notify notify) {
  const std::lock_guard notify_lock(notify_mutex_);
  notify_ = std::move(notify);
  bool something = false;
  {
    const std::lock_guard lock(mutex_);
    something = waiting_ > 0;
  }
  if (something && notify_) notify_();
}

// Whoever comes while another thread drains leaves it the work: samples enter the queue in the vendor's order.
void LoaningReader::drain() {
  if (drains_.fetch_add(1, std::memory_order_acq_rel) > 0) return;
  std::uint32_t seen = 1;
  do {
    seen = drains_.load(std::memory_order_acquire);
    while (pull()) {
    }
  } while (drains_.fetch_sub(seen, std::memory_order_acq_rel) != seen);
}

bool LoaningReader::pull() {
  if (keep_all_ && !closed_) {
    const std::lock_guard lock(mutex_);
    if (waiting_ == queue_.size()) {
      vendor_has_more_ = true;
      return false;
    }
  }
  Loan* loan = free_loan();
  if (reader_->take(loan->views, loan->infos, 1) != ReturnCode_t::RETCODE_OK) {
    const std::lock_guard lock(mutex_);
    free_.push_back(loan);
    return false;
  }
  std::uint64_t gap = 0;
  Loan* unwanted = loan;
  if (accept(*loan, gap)) {
    const std::lock_guard lock(mutex_);
    if (closed_) {
      unwanted = loan;
    } else {
      unwanted = nullptr;
      if (waiting_ == queue_.size()) {
        unwanted = queue_[first_];
        first_ = (first_ + 1) % queue_.size();
        --waiting_;
        overwritten_.fetch_add(1, std::memory_order_relaxed);
      }
      queue_[(first_ + waiting_) % queue_.size()] = loan;
      ++waiting_;
    }
  }
  if (gap > 0) {
    lost_.fetch_add(gap, std::memory_order_relaxed);
    post(Event::Kind::samples_lost, loan->info.writer, gap,
         "reader of '" + config_.topic + "' lost " + std::to_string(gap) + " samples of writer " +
             to_string(loan->info.writer) +
             ": let it keep more samples (QoS depth), or make socket buffers or shared memory larger");
  }
  if (unwanted) give_back(unwanted);
  return true;
}

LoaningReader::Loan* LoaningReader::free_loan() {
  const std::lock_guard lock(mutex_);
  if (free_.empty()) {
    all_.push_back(std::make_unique<Loan>());
    all_.back()->owner = this;
    free_.reserve(all_.size());
    return all_.back().get();
  }
  Loan* loan = free_.back();
  free_.pop_back();
  return loan;
}

void LoaningReader::give_back(Loan* loan) {
  reader_->return_loan(loan->views, loan->infos);
  const std::lock_guard lock(mutex_);
  free_.push_back(loan);
}

// Whether the sample is for the application; counts what is refused and finds gaps in the writer's sequence.
bool LoaningReader::accept(Loan& loan, std::uint64_t& gap) {
  const dds::SampleInfo& info = loan.infos[0];
  if (!info.valid_data) return false;
  loan.info.source_time = to_time(info.source_timestamp);
  loan.info.received_time = to_time(info.reception_timestamp);
  loan.info.writer = to_gid(info.sample_identity.writer_guid());
  loan.info.sequence = sequence_of(info);
  loan.bytes = {loan.views[0].data, loan.views[0].size};
  if (config_.ignore_local && loan.info.writer.same_participant(participant_->gid())) return false;
  if (closed_) return false;
  gap = gap_before(loan.info.writer, loan.info.sequence);
  if (!is_plain_cdr(loan.bytes)) {
    rejected_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  return true;
}

std::uint64_t LoaningReader::gap_before(const Gid& writer, std::uint64_t sequence) {
  const std::lock_guard lock(mutex_);
  for (auto& source : sources_) {
    if (source.writer != writer) continue;
    const std::uint64_t gap = sequence > source.last + 1 ? sequence - source.last - 1 : 0;
    source.last = std::max(source.last, sequence);
    return gap;
  }
  sources_.push_back({writer, sequence});
  return 0;
}

LinkStats LoaningReader::stats() const {
  LinkStats stats;
  stats.received = received_.load(std::memory_order_relaxed);
  stats.received_bytes = received_bytes_.load(std::memory_order_relaxed);
  stats.lost = lost_.load(std::memory_order_relaxed);
  stats.overwritten = overwritten_.load(std::memory_order_relaxed);
  stats.rejected = rejected_.load(std::memory_order_relaxed);
  stats.matched = matched_.load(std::memory_order_relaxed);
  return stats;
}

void LoaningReader::on_data_available(dds::DataReader*) {
  drain();
  const std::lock_guard notify_lock(notify_mutex_);
  if (!notify_) return;
  bool something = false;
  {
    const std::lock_guard lock(mutex_);
    something = waiting_ > 0;
  }
  if (something) notify_();
}

void LoaningReader::on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) {
  const Gid remote = to_gid(status.last_publication_handle);
  const bool matched = status.current_count_change > 0;
  matched_.store(static_cast<std::uint32_t>(status.current_count), std::memory_order_relaxed);
  if (!matched) {
    const std::lock_guard lock(mutex_);
    std::erase_if(sources_, [&](const Source& source) { return source.writer == remote; });
  }
  post(matched ? Event::Kind::matched : Event::Kind::unmatched, remote, 0,
       std::string("reader of '") + config_.topic + (matched ? "' matched writer " : "' lost writer ") +
           to_string(remote));
}

void LoaningReader::on_requested_deadline_missed(dds::DataReader*, const dds::RequestedDeadlineMissedStatus& status) {
  post(Event::Kind::deadline_missed, {}, status.total_count_change,
       "reader of '" + config_.topic + "' got no sample within its deadline (" + to_string(config_.qos) + ")");
}

void LoaningReader::on_liveliness_changed(dds::DataReader*, const dds::LivelinessChangedStatus& status) {
  if (status.not_alive_count_change <= 0) return;
  const Gid remote = to_gid(status.last_publication_handle);
  post(Event::Kind::liveliness_lost, remote, static_cast<std::uint64_t>(status.not_alive_count_change),
       "reader of '" + config_.topic + "': writer " + to_string(remote) +
           " did not assert its liveliness within its lease");
}

void LoaningReader::on_sample_rejected(dds::DataReader*, const dds::SampleRejectedStatus& status) {
  rejected_.fetch_add(status.total_count_change, std::memory_order_relaxed);
}

void LoaningReader::post(Event::Kind kind, const Gid& remote, std::uint64_t count, std::string text) {
  if (closed_) return;
  Event event;
  event.kind = kind;
  event.topic = config_.topic;
  event.is_writer = false;
  event.local = to_gid(reader_->guid());
  event.remote = remote;
  event.count = count;
  event.text = std::move(text);
  participant_->events().post(std::move(event));
}

}  // namespace adit::fastdds
