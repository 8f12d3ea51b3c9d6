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

// rmw's duration without limit: the greatest int64 of nanoseconds.
constexpr const char* kNoLimit = ":\n    sec: 9223372036\n    nsec: 854775807\n";

bool is(const std::string& text, const char* number, const char* word) {
  return text == number || text == word;
}

}  // namespace

std::string bag_qos_text(const std::vector<BagQos>& offered) {
  std::string text;
  for (std::size_t i = 0; i < offered.size(); ++i) {
    const BagQos& qos = offered[i];
    if (std::find(offered.begin(), offered.begin() + static_cast<std::ptrdiff_t>(i), qos) !=
        offered.begin() + static_cast<std::ptrdiff_t>(i)) {
      continue;
    }
    text += (text.empty() ? "" : "\n") + std::string("- history: ") + (qos.depth == 0 ? kKeepAll : kKeepLast) +
            "\n  depth: " + std::to_string(qos.depth) + "\n  reliability: " + (qos.reliable ? kReliable : kBestEffort) +
            "\n  durability: " + (qos.transient_local ? kTransientLocal : kVolatile) + "\n  deadline" + kNoLimit +
            "  lifespan" + kNoLimit + "  liveliness: 1\n  liveliness_lease_duration" + kNoLimit +
            "  avoid_ros_namespace_conventions: false";
  }
  return text;
}

Result<BagQos> bag_qos_offer(const std::string& text) {
  if (text.find_first_not_of(" \n[]") == std::string::npos) return BagQos{};
  // The stored text is a list; the reader wants a mapping around it.
  const auto document = YamlDocument::parse("profiles:\n" + text, "offered_qos_profiles");
  if (!document) return document.error();
  BagQos offer{.reliable = false, .transient_local = false, .depth = 1};
  const std::vector<YamlSection> profiles = document->root().sections("profiles");
  bool keep_all = false;
  for (const YamlSection& profile : profiles) {
    // Rosbag2 writes an unknown policy as it got it from the middleware; the default of rmw is then the safe reading.
    const std::string reliability = profile.text("reliability", kReliable);
    const std::string durability = profile.text("durability", kVolatile);
    if (!is(reliability, kBestEffort, "best_effort")) offer.reliable = true;
    if (is(durability, kTransientLocal, "transient_local")) offer.transient_local = true;
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
