// The reader history cache: where Cyclone puts arriving samples and where take() finds them. Our own one instead of
// Cyclone's default: topics without keys need only a ring, and only here losses and overwrites can be told apart.
#pragma once

#include <dds/dds.h>
#include <dds/ddsc/dds_rhc.h>

#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "middleware/cyclonedds/deadline_timer.hpp"
#include "middleware/cyclonedds/raw_type.hpp"
#include "middleware/graph.hpp"
#include "middleware/participant.hpp"

namespace adit::cyclonedds {

Gid to_gid(const ddsi_guid& guid);

// Thread-safe. Shared by the Reader and by Cyclone's reader entity, whichever goes last.
class SampleCache {
 public:
  using OnLost = std::function<void(const Gid& writer, std::uint64_t count)>;

  // Keeps the newest `depth` samples; 0 keeps all of them.
  SampleCache(std::size_t depth, OnLost on_lost);
  ~SampleCache();
  SampleCache(const SampleCache&) = delete;
  SampleCache& operator=(const SampleCache&) = delete;

  std::size_t take(std::span<Sample> out);
  void on_data(Reader::Notify notify);
  // received, received_bytes, lost, overwritten, rejected.
  LinkStats stats() const;

  // Calls `missed` for every `period` without a sample, from the first sample on. Before the reader exists.
  void watch_deadline(Duration period, std::function<void()> missed);

  // What dds_create_reader_rhc wants; it shares the ownership of `cache` until Cyclone frees it.
  static dds_rhc* make_history_cache(std::shared_ptr<SampleCache> cache);

 private:
  struct HistoryCache;
  struct Entry {
    RawSample* sample = nullptr;
    Time received{};
    Gid writer;
    std::int64_t expires = 0;  // monotonic clock; the writer's lifespan
  };
  struct WriterProgress {
    std::uint64_t handle = 0;
    std::uint64_t last = 0;  // sequence number
  };

  static const dds_rhc_ops operations_;

  void store(const ddsi_writer_info& writer, RawSample* sample);
  std::uint64_t count_gap(const ddsi_writer_info& writer, std::uint64_t sequence);
  void forget(std::uint64_t writer_handle);
  void push(const Entry& entry);

  const std::size_t depth_;
  const OnLost on_lost_;

  mutable std::mutex mutex_;  // guards the ring and the counters
  std::vector<Entry> ring_;   // grows up to depth_, then stays
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::vector<WriterProgress> writers_;
  std::unique_ptr<DeadlineTimer> deadline_;  // null: no deadline
  LinkStats stats_;

  std::mutex notify_mutex_;  // held while notify_ runs, so that on_data can promise it is not running
  Reader::Notify notify_;
};

}  // namespace adit::cyclonedds
