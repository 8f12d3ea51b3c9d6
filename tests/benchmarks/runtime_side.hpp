// The same two sides as bare/bare.hpp on the whole of ours: a Process with an executor, a component, typed messages.
#pragma once

#include <string>

#include "tests/benchmarks/bare/bare.hpp"

namespace adit::bench {

// `copied` counts the received clouds whose blob is not a view.
std::unique_ptr<Sender> make_runtime_sender(const std::string& vendor, std::uint32_t domain, std::size_t bytes);
std::unique_ptr<Receiver> make_runtime_receiver(const std::string& vendor, std::uint32_t domain, std::uint64_t& copied,
                                                OnMessage on_message);

}  // namespace adit::bench
