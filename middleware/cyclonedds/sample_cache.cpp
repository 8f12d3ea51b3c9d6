#include "middleware/cyclonedds/sample_cache.hpp"

#include <dds/ddsi/ddsi_guid.h>
#include <dds/ddsi/ddsi_rhc.h>
#include <dds/ddsi/q_bswap.h>

#include <algorithm>
#include <cstring>

namespace adit::cyclonedds {

// The object Cyclone holds; its first member is the interface.
struct SampleCache::HistoryCache : dds_rhc {
  std::shared_ptr<SampleCache> cache;

  static SampleCache& of(ddsi_rhc* rhc) { return *static_cast<HistoryCache*>(reinterpret_cast<dds_rhc*>(rhc))->cache; }
  static bool store(ddsi_rhc* rhc, const ddsi_writer_info* writer, ddsi_serdata* sample, ddsi_tkmap_instance*) {
    if (sample->kind == SDK_DATA) of(rhc).store(*writer, static_cast<RawSample*>(sample));
    return true;  // never refuse: Cyclone would repeat the delivery and block the other readers of this thread
  }
  static void unregister(ddsi_rhc* rhc, const ddsi_writer_info* writer) { of(rhc).forget(writer->iid); }
  static void free(ddsi_rhc* rhc) { delete static_cast<HistoryCache*>(reinterpret_cast<dds_rhc*>(rhc)); }
};

namespace {

// Reading through Cyclone's own API is not offered: these answer "nothing there".
std::int32_t read_nothing(dds_rhc*, bool, void**, dds_sample_info_t*, std::uint32_t, std::uint32_t,
                          dds_instance_handle_t, dds_readcond*) {
  return 0;
}
std::int32_t read_no_bytes(dds_rhc*, bool, ddsi_serdata**, dds_sample_info_t*, std::uint32_t, std::uint32_t,
                           std::uint32_t, std::uint32_t, dds_instance_handle_t) {
  return 0;
}

std::int64_t monotonic_now() {
  return ddsrt_time_monotonic().v;
}

}  // namespace

const dds_rhc_ops SampleCache::operations_ = {
    .rhc_ops = {.store = HistoryCache::store,
                .unregister_wr = HistoryCache::unregister,
                .relinquish_ownership = [](ddsi_rhc*, std::uint64_t) {},
                .set_qos = [](ddsi_rhc*, const dds_qos*) {},
                .free = HistoryCache::free},
    .read = read_nothing,
    .take = read_nothing,
    .readcdr = read_no_bytes,
    .takecdr = read_no_bytes,
    .add_readcondition = [](dds_rhc*, dds_readcond*) { return false; },
    .remove_readcondition = [](dds_rhc*, dds_readcond*) {},
    .lock_samples = [](dds_rhc*) -> std::uint32_t { return 0; },
    .associate = [](dds_rhc*, dds_reader*, const ddsi_sertype*, ddsi_tkmap*) -> dds_return_t { return 0; },
};

Gid to_gid(const ddsi_guid& guid) {
  const ddsi_guid network = nn_hton_guid(guid);
  Gid gid;
  static_assert(sizeof network == sizeof gid.bytes);
  std::memcpy(gid.bytes.data(), &network, sizeof network);
  return gid;
}

SampleCache::SampleCache(std::size_t depth, OnLost on_lost) : depth_(depth), on_lost_(std::move(on_lost)) {
  ring_.resize(depth_ == 0 ? 64 : std::min<std::size_t>(depth_, 64));
}

SampleCache::~SampleCache() {
  for (std::size_t i = 0; i < count_; ++i) ddsi_serdata_unref(ring_[(first_ + i) % ring_.size()].sample);
}

dds_rhc* SampleCache::make_history_cache(std::shared_ptr<SampleCache> cache) {
  auto* const rhc = new HistoryCache;
  rhc->common.ops = &operations_;
  rhc->cache = std::move(cache);
  return rhc;
}

void SampleCache::watch_deadline(Duration period, std::function<void()> missed) {
  deadline_ = std::make_unique<DeadlineTimer>(period, std::move(missed));
}

void SampleCache::store(const ddsi_writer_info& writer, RawSample* sample) {
  std::uint64_t lost = 0;
  bool notify = false;
  {
    const std::lock_guard lock(mutex_);
    lost = count_gap(writer, sample->sequence);
    if (deadline_) deadline_->restart();
    if (!sample->is_plain_cdr()) {
      ++stats_.rejected;
    } else {
      ddsi_serdata_ref(sample);
      push({sample, system_now(), to_gid(writer.guid), writer.lifespan_exp.v});
      notify = true;
    }
  }
  if (lost > 0 && on_lost_) on_lost_(to_gid(writer.guid), lost);
  if (notify) {
    const std::lock_guard lock(notify_mutex_);
    if (notify_) notify_();
  }
}

// A writer's first sample sets where its count starts: what it sent before we met is not lost.
std::uint64_t SampleCache::count_gap(const ddsi_writer_info& writer, std::uint64_t sequence) {
  if (sequence == 0) return 0;
  const auto known = std::find_if(writers_.begin(), writers_.end(),
                                  [&](const WriterProgress& progress) { return progress.handle == writer.iid; });
  if (known == writers_.end()) {
    writers_.push_back({writer.iid, sequence});
    return 0;
  }
  if (sequence <= known->last) return 0;
  const std::uint64_t gap = sequence - known->last - 1;
  known->last = sequence;
  stats_.lost += gap;
  return gap;
}

void SampleCache::forget(std::uint64_t writer_handle) {
  const std::lock_guard lock(mutex_);
  std::erase_if(writers_, [&](const WriterProgress& progress) { return progress.handle == writer_handle; });
  if (deadline_ && writers_.empty()) deadline_->pause();
}

void SampleCache::push(const Entry& entry) {
  if (depth_ != 0 && count_ == depth_) {
    ddsi_serdata_unref(ring_[first_].sample);
    first_ = (first_ + 1) % ring_.size();
    --count_;
    ++stats_.overwritten;
  } else if (count_ == ring_.size()) {
    std::rotate(ring_.begin(), ring_.begin() + static_cast<std::ptrdiff_t>(first_), ring_.end());
    first_ = 0;
    ring_.resize(depth_ == 0 ? 2 * ring_.size() : std::min(depth_, 2 * ring_.size()));
  }
  ring_[(first_ + count_) % ring_.size()] = entry;
  ++count_;
}

std::size_t SampleCache::take(std::span<Sample> out) {
  std::size_t taken = 0;
  const std::int64_t now = monotonic_now();
  const std::lock_guard lock(mutex_);
  while (taken < out.size() && count_ > 0) {
    const Entry entry = ring_[first_];
    first_ = (first_ + 1) % ring_.size();
    --count_;
    if (entry.expires < now) {  // outlived its lifespan here: counted like one that newer samples pushed out
      ++stats_.overwritten;
      ddsi_serdata_unref(entry.sample);
      continue;
    }
    MessageInfo info;
    info.source_time = Time(Duration(entry.sample->timestamp.v));
    info.received_time = entry.received;
    info.writer = entry.writer;
    info.sequence = entry.sample->sequence;
    ++stats_.received;
    stats_.received_bytes += entry.sample->size;
    out[taken++] = Sample(entry.sample->bytes(), info, KeepAlive(&raw_sample_reference, entry.sample));
  }
  return taken;
}

void SampleCache::on_data(Reader::Notify notify) {
  const std::lock_guard notify_lock(notify_mutex_);
  notify_ = std::move(notify);
  bool pending = false;
  {
    const std::lock_guard lock(mutex_);
    pending = count_ > 0;
  }
  if (pending && notify_) notify_();
}

LinkStats SampleCache::stats() const {
  const std::lock_guard lock(mutex_);
  return stats_;
}

}  // namespace adit::cyclonedds
