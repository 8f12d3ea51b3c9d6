#include "components/tunnel_simulator/yaml_reader.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdlib>
#include <numbers>

namespace adit::tunnel_simulator {
namespace {

int line_of(const YAML::Node& node) {
  return node.Mark().line + 1;
}

// Text such as "50 km/h" to its SI value.
std::optional<double> quantity(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || !std::isfinite(value)) return std::nullopt;
  std::string unit(end);
  unit.erase(0, unit.find_first_not_of(' ') == std::string::npos ? unit.size() : unit.find_first_not_of(' '));
  if (unit.empty() || unit == "m" || unit == "s" || unit == "m/s" || unit == "Hz" || unit == "rad" || unit == "K")
    return value;
  if (unit == "km/h") return value / 3.6;
  if (unit == "deg") return value * std::numbers::pi / 180.0;
  if (unit == "ms") return value * 1e-3;
  if (unit == "us") return value * 1e-6;
  if (unit == "mK") return value * 1e-3;
  if (unit == "cm") return value * 1e-2;
  if (unit == "km") return value * 1e3;
  if (unit == "min") return value * 60.0;
  if (unit == "%") return value * 1e-2;
  return std::nullopt;
}

std::string shown(double value) {
  std::string s = std::to_string(value);
  s.erase(s.find_last_not_of('0') + 1);
  if (!s.empty() && s.back() == '.') s.pop_back();
  return s;
}

}  // namespace

YamlDocument::YamlDocument(std::string path) : path_(std::move(path)), root_(std::make_unique<YAML::Node>()) {
  try {
    *root_ = YAML::LoadFile(path_);
  } catch (const YAML::BadFile&) {
    fail(0, "cannot be read", ErrorCode::not_found);
  } catch (const YAML::Exception& e) {
    fail(e.mark.line + 1, e.msg);
  }
}

YamlDocument::~YamlDocument() = default;

YamlMap YamlDocument::root(const std::string& what) {
  return {*this, *root_, what};
}

void YamlDocument::fail(int line, const std::string& message, ErrorCode code) {
  if (error_) return;
  error_ = Error{code, path_ + ":" + (line > 0 ? std::to_string(line) + ":" : "") + " " + message};
}

YamlMap::YamlMap(YamlDocument& document, const YAML::Node& node, std::string what)
    : document_(&document), node_(std::make_unique<YAML::Node>(node)), what_(std::move(what)) {
  if (!document.ok() || !node.IsDefined() || node.IsNull()) return;
  if (!node.IsMap()) {
    document.fail(line_of(node), what_ + " must be a mapping (key: value)");
    return;
  }
  std::set<std::string> seen;
  for (const auto& entry : node) {
    if (!entry.first.IsScalar()) {
      document.fail(line_of(entry.first), what_ + ": a key must be a word");
    } else if (!seen.insert(entry.first.Scalar()).second) {
      document.fail(line_of(entry.first), what_ + ": key '" + entry.first.Scalar() + "' appears twice");
    }
  }
}

YamlMap::~YamlMap() = default;
YamlMap::YamlMap(YamlMap&&) noexcept = default;

bool YamlMap::ok() const {
  return document_->ok();
}

bool YamlMap::has(const std::string& key) const {
  if (!node_->IsDefined() || !node_->IsMap()) return false;
  for (const auto& entry : *node_) {
    if (entry.first.IsScalar() && entry.first.Scalar() == key) return true;
  }
  return false;
}

YAML::Node YamlMap::get(const std::string& key) {
  asked_.insert(key);
  if (node_->IsDefined() && node_->IsMap()) {
    for (const auto& entry : *node_) {
      if (entry.first.IsScalar() && entry.first.Scalar() == key) return entry.second;
    }
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

void YamlMap::fail(const std::string& message, const std::string& key) {
  const YAML::Node at = key.empty() ? *node_ : get(key);
  document_->fail(at.IsDefined() ? line_of(at) : line_of(*node_),
                  (key.empty() ? what_ : what_ + "." + key) + ": " + message);
}

void YamlMap::require(const std::string& key) {
  if (!has(key)) fail("key '" + key + "' is missing");
}

double YamlMap::number(const std::string& key, double fallback, double low, double high) {
  const YAML::Node node = get(key);
  if (!document_->ok() || !node.IsDefined()) return fallback;
  const auto value = node.IsScalar() ? quantity(node.Scalar()) : std::nullopt;
  if (!value) {
    fail("expected a number, optionally with a unit (m, cm, km, s, ms, us, min, m/s, km/h, deg, Hz, K, mK, %)", key);
    return fallback;
  }
  if (*value < low || *value > high) {
    fail(shown(*value) + " is not within [" + shown(low) + ", " + shown(high) + "]", key);
    return fallback;
  }
  return *value;
}

int YamlMap::integer(const std::string& key, int fallback, int low, int high) {
  const double value = number(key, fallback, low, high);
  if (value != std::floor(value)) {
    fail("expected a whole number", key);
    return fallback;
  }
  return static_cast<int>(value);
}

bool YamlMap::boolean(const std::string& key, bool fallback) {
  const YAML::Node node = get(key);
  if (!document_->ok() || !node.IsDefined()) return fallback;
  if (node.IsScalar() && (node.Scalar() == "true" || node.Scalar() == "false")) return node.Scalar() == "true";
  fail("expected true or false", key);
  return fallback;
}

std::string YamlMap::text(const std::string& key, const std::string& fallback) {
  const YAML::Node node = get(key);
  if (!document_->ok() || !node.IsDefined()) return fallback;
  if (node.IsScalar()) return node.Scalar();
  fail("expected text", key);
  return fallback;
}

std::size_t YamlMap::choice(const std::string& key, std::size_t fallback, const std::vector<std::string>& choices) {
  const YAML::Node node = get(key);
  if (!document_->ok() || !node.IsDefined()) return fallback;
  std::string list;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (node.IsScalar() && node.Scalar() == choices[i]) return i;
    list += (i > 0 ? ", " : "") + choices[i];
  }
  fail("expected one of " + list, key);
  return fallback;
}

std::vector<double> YamlMap::numbers(const std::string& key, std::size_t count, double low, double high) {
  const YAML::Node node = get(key);
  std::vector<double> out;
  if (!document_->ok() || !node.IsDefined()) return out;
  if (!node.IsSequence() || (count > 0 && node.size() != count)) {
    fail("expected a list of " + (count > 0 ? std::to_string(count) + " " : std::string()) + "numbers", key);
    return out;
  }
  for (const YAML::Node& item : node) {
    const auto value = item.IsScalar() ? quantity(item.Scalar()) : std::nullopt;
    if (!value || *value < low || *value > high) {
      fail("each number must be within [" + shown(low) + ", " + shown(high) + "]", key);
      return {};
    }
    out.push_back(*value);
  }
  return out;
}

std::vector<std::string> YamlMap::texts(const std::string& key) {
  const YAML::Node node = get(key);
  std::vector<std::string> out;
  if (!document_->ok() || !node.IsDefined()) return out;
  if (!node.IsSequence()) {
    fail("expected a list", key);
    return out;
  }
  for (const YAML::Node& item : node) {
    if (!item.IsScalar()) {
      fail("expected a list of words", key);
      return {};
    }
    out.push_back(item.Scalar());
  }
  return out;
}

YamlMap YamlMap::map(const std::string& key) {
  return {*document_, get(key), what_ + "." + key};
}

std::vector<YamlMap> YamlMap::maps(const std::string& key) {
  const YAML::Node node = get(key);
  std::vector<YamlMap> out;
  if (!document_->ok() || !node.IsDefined() || node.IsNull()) return out;
  if (!node.IsSequence()) {
    fail("expected a list", key);
    return out;
  }
  for (const YAML::Node& item : node) {
    out.emplace_back(*document_, item, what_ + "." + key + "[" + std::to_string(out.size()) + "]");
  }
  return out;
}

void YamlMap::finish() {
  if (!document_->ok() || !node_->IsDefined() || !node_->IsMap()) return;
  for (const auto& entry : *node_) {
    if (asked_.count(entry.first.Scalar()) != 0) continue;
    std::string known;
    for (const std::string& k : asked_) known += (known.empty() ? "" : ", ") + k;
    document_->fail(line_of(entry.first),
                    what_ + ": unknown key '" + entry.first.Scalar() + "' (known: " + known + ")");
  }
}

}  // namespace adit::tunnel_simulator
