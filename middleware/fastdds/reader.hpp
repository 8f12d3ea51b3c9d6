#pragma once

#include <atomic>
#include <memory>
#include <mutex>

#include <fastdds/dds/core/LoanableSequence.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "middleware/fastdds/serialized_type.hpp"
#include "middleware/fastdds/vendor_participant.hpp"
#include "middleware/participant.hpp"

namespace adit::fastdds {

// The vendor's reader with a queue of `depth` loaned samples in front of the application. Samples go from the vendor's
// history into the queue as they arrive, on the vendor's thread: so what is overwritten is counted exactly, and what a
// reader with ignore_local does not want never wakes anybody.
//
// Lifetime: counted references, one of the FastReader and one of each sample the application holds. The vendor does not
// delete a reader with outstanding loans, so a destroyed FastReader leaves this behind, deaf, until the last sample is
// released; to remote participants it stays a matched reader that long.
class LoaningReader final : private dds::DataReaderListener {
 public:
  // With one reference, for the caller.
  static Result<LoaningReader*> create(std::shared_ptr<VendorParticipant> participant, const EndpointConfig& config);
  void release_reference();
  // Gives back the queue and goes deaf: nothing is queued or notified any more.
  void close();

  std::size_t take(std::span<Sample> out);
  void on_data(Reader::Notify notify);
  LinkStats stats() const;
  const EndpointConfig& config() const { return config_; }
  Gid gid() const { return gid_; }

 private:
  // One loan of one sample; reused, so that taking allocates nothing once the pool is warm.
  struct Loan {
    dds::LoanableSequence<PayloadView> views;
    dds::LoanableSequence<dds::SampleInfo> infos;
    Bytes bytes;
    MessageInfo info;
    std::atomic<std::uint32_t> references{0};
    LoaningReader* owner = nullptr;
  };
  // What a writer sent last, to see gaps.
  struct Source {
    Gid writer;
    std::uint64_t last = 0;
  };
  static const KeepAliveOperations keep_alive_operations;

  LoaningReader(std::shared_ptr<VendorParticipant> participant, const EndpointConfig& config);
  ~LoaningReader() override;

  void drain();
  bool pull();  // one sample from the vendor's history into the queue; false: nothing there, or no room
  Loan* free_loan();
  void give_back(Loan* loan);
  bool accept(Loan& loan, std::uint64_t& gap);
  std::uint64_t gap_before(const Gid& writer, std::uint64_t sequence);

  void on_data_available(dds::DataReader*) override;
  void on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) override;
  void on_requested_deadline_missed(dds::DataReader*, const dds::RequestedDeadlineMissedStatus& status) override;
  void on_liveliness_changed(dds::DataReader*, const dds::LivelinessChangedStatus& status) override;
  void on_sample_rejected(dds::DataReader*, const dds::SampleRejectedStatus& status) override;
  void post(Event::Kind kind, const Gid& remote, std::uint64_t count, std::string text);

  std::shared_ptr<VendorParticipant> participant_;
  const EndpointConfig config_;
  const bool keep_all_;
  dds::DataReader* reader_ = nullptr;
  bool has_topic_ = false;
  Gid gid_;

  std::atomic<std::uint32_t> references_{1};
  std::atomic<std::uint32_t> drains_{0};
  std::atomic<bool> closed_{false};

  std::mutex mutex_;          // the members below; a leaf
  std::vector<Loan*> queue_;  // ring of fixed size
  std::size_t first_ = 0, waiting_ = 0, outstanding_ = 0;
  bool vendor_has_more_ = false;  // keep all: the queue was full when samples arrived
  std::vector<Loan*> free_;
  std::vector<std::unique_ptr<Loan>> all_;
  std::vector<Source> sources_;

  std::mutex notify_mutex_;  // held while notifying
  Reader::Notify notify_;

  std::atomic<std::uint64_t> received_{0}, received_bytes_{0}, lost_{0}, overwritten_{0}, rejected_{0};
  std::atomic<std::uint32_t> matched_{0};
};

class FastReader final : public Reader {
 public:
  explicit FastReader(LoaningReader* reader) : reader_(reader) {}
  ~FastReader() override {
    reader_->close();
    reader_->release_reference();
  }
  FastReader(const FastReader&) = delete;
  FastReader& operator=(const FastReader&) = delete;

  std::size_t take(std::span<Sample> out) override { return reader_->take(out); }
  void on_data(Notify notify) override { reader_->on_data(std::move(notify)); }
  LinkStats stats() const override { return reader_->stats(); }
  const EndpointConfig& config() const override { return reader_->config(); }
  Gid gid() const override { return reader_->gid(); }

 private:
  LoaningReader* reader_;
};

}  // namespace adit::fastdds
