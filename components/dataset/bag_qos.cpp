#include "components/dataset/bag_qos.hpp"

#include <algorithm>

#include "components/config/yaml_reader.hpp"

namespace adit::dataset {
namespace {

// rmw/types.h: the values of its policy enumerations, 0 being "system default" and "unknown" the last.
constexpr const char* kKeepLast = "1";
constexpr const char* kKeepAll = "2";
constexpr const char* kReliable = "1";
constexpr const char* kBestEffort = "2";
constexpr const char* kTransientLocal = "1";
constexpr const char* kVolatile = "2";
constexpr std::uint32_t kGreatestDepth = 100'000;  // above it the number is damaged, or means "all"

// A duration of rmw; without limit: the greatest int64 of nanoseconds.
std::string duration(const char* key, const std::optional<Duration>& value) {
  const std::int64_t nanoseconds = value.value_or(Duration::max()).count();
  return std::string("  ") + key + ":\n    sec: " + std::to_string(nanoseconds / 1'000'000'000) +
         "\n    nsec: " + std::to_string(nanoseconds % 1'000'000'000) + "\n";
}

bool is(const std::string& text, const char* number, const char* word) {
  return text == number || text == word;
}

}  // namespace

std::string bag_qos(const Qos& offered) {
  const bool manual = offered.liveliness == Qos::Liveliness::manual_by_topic;
  return std::string("- history: ") + (offered.depth == 0 ? kKeepAll : kKeepLast) +
         "\n  depth: " + std::to_string(offered.depth) +
         "\n  reliability: " + (offered.reliability == Qos::Reliability::reliable ? kReliable : kBestEffort) +
         "\n  durability: " + (offered.durability == Qos::Durability::transient_local ? kTransientLocal : kVolatile) +
         "\n" + duration("deadline", offered.deadline) + duration("lifespan", offered.lifespan) +
         "  liveliness: " + (manual ? "3" : "1") + "\n" + duration("liveliness_lease_duration", offered.lease) +
         "  avoid_ros_namespace_conventions: false";
}

Result<Qos> bag_qos_offer(const std::string& text) {
  if (text.find_first_not_of(" \n[]") == std::string::npos) return Qos::reliable(10);
  // The stored text is a list; the reader wants a mapping around it.
  const auto document = YamlDocument::parse("profiles:\n" + text, "offered_qos_profiles");
  if (!document) return document.error();
  Qos offer;
  offer.reliability = Qos::Reliability::best_effort;
  offer.depth = 1;
  const std::vector<YamlSection> profiles = document->root().sections("profiles");
  bool keep_all = false;
  for (const YamlSection& profile : profiles) {
    // Rosbag2 writes an unknown policy as it got it from the middleware; the default of rmw is then the safe reading.
    const std::string reliability = profile.text("reliability", kReliable);
    const std::string durability = profile.text("durability", kVolatile);
    if (!is(reliability, kBestEffort, "best_effort")) offer.reliability = Qos::Reliability::reliable;
    if (is(durability, kTransientLocal, "transient_local")) offer.durability = Qos::Durability::transient_local;
    keep_all |= is(profile.text("history", kKeepLast), kKeepAll, "keep_all");
    const std::int64_t depth = profile.integer("depth", 10);
    if (depth > kGreatestDepth) keep_all = true;
    offer.depth = std::max(offer.depth, static_cast<std::uint32_t>(std::clamp<std::int64_t>(depth, 1, kGreatestDepth)));
  }
  if (!document->root().ok() || profiles.empty()) {
    return Error{ErrorCode::malformed, "QoS profiles of the bag are not understood: " + text.substr(0, 80)};
  }
  if (keep_all) offer.depth = 0;
  return offer;
}

}  // namespace adit::dataset
