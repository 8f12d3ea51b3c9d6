#include "middleware/qos.hpp"

#include <cstdio>

namespace adit {
namespace {

const char* name(Qos::Reliability value) {
  return value == Qos::Reliability::reliable ? "reliable" : "best effort";
}
const char* name(Qos::Durability value) {
  return value == Qos::Durability::transient_local ? "transient local" : "volatile";
}
const char* name(Qos::Liveliness value) {
  return value == Qos::Liveliness::manual_by_topic ? "manual by topic" : "automatic";
}

std::string name(const std::optional<Duration>& value) {
  if (!value) return "infinite";
  char text[48];
  std::snprintf(text, sizeof text, "%.6g ms", std::chrono::duration<double, std::milli>(*value).count());
  return text;
}

// Infinite is longer than any duration.
bool longer(const std::optional<Duration>& a, const std::optional<Duration>& b) {
  return b && (!a || *a > *b);
}

}  // namespace

Qos Qos::sensor() {
  Qos qos;
  qos.reliability = Reliability::best_effort;
  qos.depth = 5;
  return qos;
}

Qos Qos::reliable(std::uint32_t depth) {
  Qos qos;
  qos.depth = depth;
  return qos;
}

Qos Qos::latched(std::uint32_t depth) {
  Qos qos;
  qos.durability = Durability::transient_local;
  qos.depth = depth;
  return qos;
}

Qos Qos::clock() {
  Qos qos = sensor();
  qos.depth = 1;
  return qos;
}

Qos Qos::rosout() {
  Qos qos = latched(1000);
  qos.lifespan = std::chrono::seconds(10);
  return qos;
}

Qos Qos::tf() {
  return reliable(100);
}

std::string to_string(const Qos& qos) {
  std::string text = std::string(name(qos.reliability)) + ", " + name(qos.durability) + ", ";
  text += qos.depth == 0 ? "keep all" : "keep last " + std::to_string(qos.depth);
  if (qos.deadline) text += ", deadline " + name(qos.deadline);
  if (qos.lifespan) text += ", lifespan " + name(qos.lifespan);
  if (qos.liveliness != Qos::Liveliness::automatic || qos.lease) {
    text += std::string(", liveliness ") + name(qos.liveliness) + " lease " + name(qos.lease);
  }
  return text;
}

Result<void> validate(const Qos& qos) {
  const auto positive = [](const std::optional<Duration>& value) { return !value || *value > Duration::zero(); };
  if (!positive(qos.deadline)) return Error{ErrorCode::invalid_argument, "QoS deadline must be greater than 0"};
  if (!positive(qos.lifespan)) return Error{ErrorCode::invalid_argument, "QoS lifespan must be greater than 0"};
  if (!positive(qos.lease)) return Error{ErrorCode::invalid_argument, "QoS liveliness lease must be greater than 0"};
  if (qos.max_blocking < Duration::zero()) {
    return Error{ErrorCode::invalid_argument, "QoS max_blocking must not be negative"};
  }
  return {};
}

std::vector<Mismatch> check(const Qos& offered, const Qos& requested) {
  std::vector<Mismatch> failing;
  if (offered.reliability < requested.reliability) {
    failing.push_back({"reliability", name(offered.reliability), name(requested.reliability),
                       "make the writer reliable, or let the reader ask for best effort"});
  }
  if (offered.durability < requested.durability) {
    failing.push_back({"durability", name(offered.durability), name(requested.durability),
                       "make the writer transient local (latched), or let the reader ask for volatile"});
  }
  if (longer(offered.deadline, requested.deadline)) {
    failing.push_back({"deadline", name(offered.deadline), name(requested.deadline),
                       "let the writer promise a shorter deadline, or the reader ask for a longer one"});
  }
  if (offered.liveliness < requested.liveliness) {
    failing.push_back({"liveliness", name(offered.liveliness), name(requested.liveliness),
                       "make the writer assert its liveliness by topic, or let the reader ask for automatic"});
  }
  if (longer(offered.lease, requested.lease)) {
    failing.push_back({"liveliness lease", name(offered.lease), name(requested.lease),
                       "let the writer promise a shorter lease, or the reader ask for a longer one"});
  }
  return failing;
}

}  // namespace adit
