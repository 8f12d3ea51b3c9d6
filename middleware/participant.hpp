// The seam. Everything here speaks serialized samples; types live above. Both vendors implement these three classes,
// and so do the decorators (ros/ names and graph, fault/ injection).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "idl/result.hpp"
#include "idl/type_info.hpp"
#include "middleware/config.hpp"
#include "middleware/graph.hpp"
#include "middleware/sample.hpp"

namespace adit {

// Publishes samples of one topic. Any thread; calls on one writer are serialized by the vendor. Destroy it before its
// participant.
class Writer {
 public:
  virtual ~Writer() = default;

  // Encodes straight into the vendor's buffer and sends. Blocks at most qos.max_blocking (a reliable reader is full),
  // then fails with `timeout` and counts send_failed. No heap allocation once the vendor's pools are warm.
  virtual Result<void> publish(const Encoder& message, Time source_time) = 0;
  Result<void> publish(const Encoder& message) { return publish(message, system_now()); }
  // Sends a sample that is serialized already (player, bridge, recorder tests), encapsulation header included.
  virtual Result<void> forward(Bytes cdr, Time source_time) = 0;
  Result<void> forward(Bytes cdr) { return forward(cdr, system_now()); }

  // True while a reader outside this participant is matched. Lock-free: the publish path asks it each time.
  virtual bool has_remote_readers() const = 0;
  // Waits until every matched reliable reader has acknowledged all samples.
  virtual Result<void> wait_for_acknowledgements(Duration timeout) = 0;
  virtual LinkStats stats() const = 0;
  virtual const EndpointConfig& config() const = 0;
  virtual Gid gid() const = 0;
};

// Receives samples of one topic. Destroy it before its participant; samples taken from it may live on.
class Reader {
 public:
  // Called on a thread of the middleware: signal somebody and return. Must not take, block or throw.
  using Notify = std::function<void()>;

  virtual ~Reader() = default;

  // Moves the oldest unread samples into `out` and returns how many. Never blocks, never allocates in steady state.
  // One thread at a time.
  virtual std::size_t take(std::span<Sample> out) = 0;
  // Calls `notify` whenever samples may be there to take, at once if there are some already. Replaces the previous one;
  // when on_data returns, the previous one is not running and will not be called again. nullptr removes it.
  virtual void on_data(Notify notify) = 0;

  virtual LinkStats stats() const = 0;
  virtual const EndpointConfig& config() const = 0;
  virtual Gid gid() const = 0;
};

// One member of a DDS domain. Thread-safe. Destroying it leaves the domain; its writers and readers must be gone.
class Participant {
 public:
  virtual ~Participant() = default;

  // Fails with `incompatible` when the topic exists with another type, `invalid_argument` for an invalid QoS or name.
  virtual Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) = 0;
  virtual Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) = 0;

  virtual Graph graph() const = 0;
  // Matches, QoS mismatches, losses of our endpoints. Called on a middleware thread: be short, do not call back into
  // the participant. Same replacement rule as Reader::on_data.
  virtual void on_event(EventHandler handler) = 0;
  // The vendor configuration really in force (transports, buffers as granted, sizes, discovery), for a person to read.
  // Lines whose first word is "warning" ask for something to be done (small kernel buffers, no shared memory, ...).
  virtual std::string explain() const = 0;

  virtual const ParticipantConfig& config() const = 0;
  virtual Gid gid() const = 0;
};

// Joins a domain. `config.vendor` picks the middleware; several participants, also of different vendors, may be open in
// one process. Refusals say what to do: unknown vendor or one not built in (with the list of those that are), domain
// out of range, interface that does not exist, no free participant index, unreadable keystore.
Result<std::unique_ptr<Participant>> open(const ParticipantConfig& config);

// The warnings of an explanation, without that word: what a process logs when it starts.
std::vector<std::string> warnings_in(const std::string& explanation);

// The vendors this build can open, in order of preference.
std::span<const std::string_view> built_in_vendors();

}  // namespace adit
