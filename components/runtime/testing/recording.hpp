// A recording made by a test, played into an OfflineRunner, and what comes out of it collected.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "components/runtime/offline_runner.hpp"

namespace adit::testing {

class Recording final : public OfflineSource {
 public:
  Recording() = default;
  explicit Recording(std::vector<OfflineMessage> messages) : messages_(std::move(messages)) {}

  // In the order of the calls; sort() puts them in the order of their arrival.
  template <class T>
  void add(const std::string& topic, Time arrival, std::shared_ptr<T> message) {
    messages_.push_back(offline_message<std::remove_const_t<T>>(topic, arrival, std::move(message)));
  }
  void sort() {
    std::stable_sort(messages_.begin(), messages_.end(),
                     [](const OfflineMessage& a, const OfflineMessage& b) { return a.stamp < b.stamp; });
  }
  Result<bool> next(OfflineMessage& out) override {
    if (next_ == messages_.size()) return false;
    out = messages_[next_++];
    return true;
  }

 private:
  std::vector<OfflineMessage> messages_;
  std::size_t next_ = 0;
};

// Copies of what a topic carries, which must be of type T. `out` outlives the tap.
template <class T>
OfflineRunner::Sink into(std::vector<T>& out) {
  return [&out](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
    out.push_back(*static_cast<const T*>(message.get()));
  };
}

}  // namespace adit::testing
