#include "components/config/yaml_reader.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "components/config/quantity.hpp"

namespace adit {

struct YamlDocument::State {
  std::string name;
  YAML::Node root;
  std::vector<std::pair<int, std::string>> errors;  // line, "file:line: message"
  std::vector<std::shared_ptr<YamlSection::Content>> sections;
};

struct YamlSection::Content {
  YamlDocument::State* document;
  YAML::Node node;  // a map, or undefined for an absent section
  int line = 0;
  std::set<std::string, std::less<>> known;  // keys somebody asked for

  void error(int at_line, const std::string& message) const {
    document->errors.emplace_back(at_line, document->name + ":" + std::to_string(at_line) + ": " + message);
  }
  // The value under a key; marks the key as known. Undefined when absent.
  YAML::Node find(std::string_view key) {
    known.emplace(key);
    if (!node.IsDefined() || !node.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
    for (const auto& entry : node) {
      if (entry.first.Scalar() == key) return entry.second;
    }
    return YAML::Node(YAML::NodeType::Undefined);
  }
  // The parsed value under `key`; `otherwise` when absent; an error when it is required or not `what`.
  template <class T, class Parse>
  T get(std::string_view key, std::optional<T> otherwise, Parse parse, const char* what);
  int line_of(std::string_view key) const {
    if (node.IsDefined() && node.IsMap()) {
      for (const auto& entry : node) {
        if (entry.first.Scalar() == key) return entry.first.Mark().line + 1;
      }
    }
    return line;
  }
};

namespace {

int line_of(const YAML::Node& node) {
  return node.Mark().line + 1;
}

bool quoted(const YAML::Node& node) {
  return node.Tag() == "!";
}

std::optional<bool> parse_flag(const YAML::Node& node) {
  if (!node.IsScalar() || quoted(node)) return std::nullopt;
  const std::string& text = node.Scalar();
  if (text == "true" || text == "True" || text == "TRUE") return true;
  if (text == "false" || text == "False" || text == "FALSE") return false;
  return std::nullopt;
}

template <class Number>
std::optional<Number> parse_as(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  Number value{};
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (bad != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<std::int64_t> parse_integer(const YAML::Node& node) {
  if (!node.IsScalar() || quoted(node)) return std::nullopt;
  return parse_as<std::int64_t>(node.Scalar());
}

std::optional<double> parse_number(const YAML::Node& node) {
  if (!node.IsScalar() || quoted(node)) return std::nullopt;
  const std::optional<double> value = parse_as<double>(node.Scalar());
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<std::string> parse_text(const YAML::Node& node) {
  return node.IsScalar() ? std::optional(node.Scalar()) : std::nullopt;
}

std::optional<std::chrono::nanoseconds> parse_duration(const YAML::Node& node) {
  if (!node.IsScalar()) return std::nullopt;
  const std::string& text = node.Scalar();
  const std::size_t unit = text.find_last_of("0123456789.") + 1;
  const std::optional<double> value = parse_as<double>(std::string_view(text).substr(0, unit));
  if (!value || !std::isfinite(*value)) return std::nullopt;
  static const std::map<std::string, double> seconds = {{"", 1.0},    {"s", 1.0},    {"ms", 1e-3}, {"us", 1e-6},
                                                        {"ns", 1e-9}, {"min", 60.0}, {"h", 3600.0}};
  const auto scale = seconds.find(text.substr(unit));
  if (scale == seconds.end()) return std::nullopt;
  const double nanoseconds = *value * scale->second * 1e9;
  if (std::abs(nanoseconds) > 9e18) return std::nullopt;
  return std::chrono::nanoseconds(std::llround(nanoseconds));
}

template <class T>
std::optional<std::vector<T>> parse_list(const YAML::Node& node, std::optional<T> (*parse)(const YAML::Node&)) {
  if (!node.IsSequence()) return std::nullopt;
  std::vector<T> values;
  for (const YAML::Node& item : node) {
    const std::optional<T> value = parse(item);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  return values;
}

std::string shown(const YAML::Node& node) {
  return node.IsScalar()     ? "'" + node.Scalar() + "'"
         : node.IsSequence() ? "a list"
         : node.IsMap()      ? "a section"
                             : "nothing";
}

template <class List>
std::optional<YamlValue> as_value(std::optional<List> list) {
  return list ? std::optional<YamlValue>(*std::move(list)) : std::nullopt;
}

std::string range_text(const YamlRange& range, std::string_view unit) {
  std::ostringstream text;
  text << "[" << range.minimum << ", " << range.maximum << "]";
  if (!unit.empty()) text << " " << unit;
  return text.str();
}

}  // namespace
template <class T, class Parse>
T YamlSection::Content::get(std::string_view key, std::optional<T> otherwise, Parse parse, const char* what) {
  const YAML::Node found = find(key);
  if (!found.IsDefined()) {
    if (!otherwise) error(line, "'" + std::string(key) + "' is missing: give " + what);
    return otherwise.value_or(T{});
  }
  std::optional<T> value = parse(found);
  if (!value) error(line_of(key), "'" + std::string(key) + "' must be " + what + ", not " + shown(found));
  return value ? *std::move(value) : std::move(otherwise).value_or(T{});
}

bool YamlSection::has(std::string_view key) const {
  return content_->find(key).IsDefined();
}

bool YamlSection::is_section(std::string_view key) const {
  const YAML::Node found = content_->find(key);
  return found.IsDefined() && found.IsMap();
}

std::vector<std::string> YamlSection::keys() const {
  std::vector<std::string> names;
  if (content_->node.IsDefined() && content_->node.IsMap()) {
    for (const auto& entry : content_->node) names.push_back(entry.first.Scalar());
  }
  return names;
}

double YamlSection::number(std::string_view key, std::optional<double> otherwise, YamlRange range,
                           std::string_view unit) const {
  const double value = content_->get(key, otherwise, parse_number, "a number");
  if (value < range.minimum || value > range.maximum) {
    error(key, "'" + std::string(key) + "' must lie in " + range_text(range, unit));
    return otherwise.value_or(0.0);
  }
  return value;
}

double YamlSection::quantity(std::string_view key, std::optional<double> otherwise, YamlRange range) const {
  const YAML::Node found = content_->find(key);
  if (!found.IsDefined()) return content_->get(key, otherwise, parse_number, "a number");
  const std::optional<double> value = found.IsScalar() ? parse_quantity(found.Scalar()) : std::nullopt;
  if (!value) {
    error(key, "'" + std::string(key) + "': expected a number, optionally with a unit (" + quantity_units() +
                   "), not " + shown(found));
  } else if (*value < range.minimum || *value > range.maximum) {
    error(key, "'" + std::string(key) + "': " + shown(found) + " is not within " + range_text(range, "in SI units"));
  } else {
    return *value;
  }
  return otherwise.value_or(0.0);
}

std::vector<double> YamlSection::quantities(std::string_view key, std::size_t count, YamlRange range) const {
  const YAML::Node found = content_->find(key);
  std::vector<double> list;
  if (!found.IsDefined()) return list;
  if (found.IsSequence()) {
    for (const YAML::Node& item : found) {
      const std::optional<double> value = item.IsScalar() ? parse_quantity(item.Scalar()) : std::nullopt;
      if (value && *value >= range.minimum && *value <= range.maximum) list.push_back(*value);
    }
    if (list.size() == count && found.size() == count) return list;
  }
  error(key, "'" + std::string(key) + "': expected a list of " + std::to_string(count) + " numbers within " +
                 range_text(range, "in SI units"));
  return {};
}

std::int64_t YamlSection::integer(std::string_view key, std::optional<std::int64_t> otherwise, YamlRange range) const {
  const std::int64_t value = content_->get(key, otherwise, parse_integer, "a whole number");
  if (static_cast<double>(value) < range.minimum || static_cast<double>(value) > range.maximum) {
    error(key, "'" + std::string(key) + "' must lie in " + range_text(range, ""));
    return otherwise.value_or(0);
  }
  return value;
}

bool YamlSection::flag(std::string_view key, std::optional<bool> otherwise) const {
  return content_->get(key, otherwise, parse_flag, "true or false");
}

std::string YamlSection::text(std::string_view key, std::optional<std::string> otherwise) const {
  return content_->get(key, std::move(otherwise), parse_text, "text");
}

std::string YamlSection::choice(std::string_view key, const std::vector<std::string>& allowed,
                                std::optional<std::string> otherwise) const {
  std::string list;
  for (const std::string& value : allowed) list += (list.empty() ? "" : ", ") + value;
  const std::string what = "one of " + list;
  const auto parse = [&](const YAML::Node& node) -> std::optional<std::string> {
    if (!node.IsScalar() || std::find(allowed.begin(), allowed.end(), node.Scalar()) == allowed.end()) return {};
    return node.Scalar();
  };
  return content_->get(key, std::move(otherwise), parse, what.c_str());
}

std::chrono::nanoseconds YamlSection::duration(std::string_view key,
                                               std::optional<std::chrono::nanoseconds> otherwise) const {
  return content_->get(key, otherwise, parse_duration, "a duration (1s, 250ms, 2min)");
}

std::vector<double> YamlSection::numbers(std::string_view key, std::optional<std::vector<double>> otherwise) const {
  const auto parse = [](const YAML::Node& node) { return parse_list<double>(node, parse_number); };
  return content_->get(key, std::move(otherwise), parse, "a list of numbers");
}

std::vector<std::int64_t> YamlSection::integers(std::string_view key,
                                                std::optional<std::vector<std::int64_t>> otherwise) const {
  const auto parse = [](const YAML::Node& node) { return parse_list<std::int64_t>(node, parse_integer); };
  return content_->get(key, std::move(otherwise), parse, "a list of whole numbers");
}

std::vector<std::string> YamlSection::texts(std::string_view key,
                                            std::optional<std::vector<std::string>> otherwise) const {
  const auto parse = [](const YAML::Node& node) { return parse_list<std::string>(node, parse_text); };
  return content_->get(key, std::move(otherwise), parse, "a list of texts");
}

std::optional<YamlValue> YamlSection::value(std::string_view key) const {
  const YAML::Node found = content_->find(key);
  if (found.IsScalar()) {
    if (const auto flag = parse_flag(found)) return *flag;
    if (const auto integer = parse_integer(found)) return *integer;
    if (const auto number = parse_number(found)) return *number;
    return found.Scalar();
  }
  if (found.IsSequence()) {
    if (auto list = as_value(parse_list<bool>(found, parse_flag))) return list;
    if (auto list = as_value(parse_list<std::int64_t>(found, parse_integer))) return list;
    if (auto list = as_value(parse_list<double>(found, parse_number))) return list;
    if (auto list = as_value(parse_list<std::string>(found, parse_text))) return list;
  }
  error(key, "'" + std::string(key) + "' must be a value or a list of values, not " + shown(found));
  return std::nullopt;
}

YamlSection YamlSection::section(std::string_view key) const {
  auto content = std::make_shared<Content>();
  content->document = content_->document;
  content->line = content_->line_of(key);
  const YAML::Node found = content_->find(key);
  if (found.IsDefined() && !found.IsNull()) {
    if (found.IsMap()) {
      content->node.reset(found);
    } else {
      error(key, "'" + std::string(key) + "' must be a section (key: value), not " + shown(found));
    }
  }
  content_->document->sections.push_back(content);
  return YamlSection(content);
}

std::vector<YamlSection> YamlSection::sections(std::string_view key) const {
  std::vector<YamlSection> list;
  const YAML::Node found = content_->find(key);
  if (!found.IsDefined() || found.IsNull()) return list;
  if (!found.IsSequence()) {
    error(key, "'" + std::string(key) + "' must be a list of sections, not " + shown(found));
    return list;
  }
  for (const YAML::Node& item : found) {
    if (!item.IsMap()) {
      content_->error(adit::line_of(item),
                      "an entry of '" + std::string(key) + "' must be a section (key: value), not " + shown(item));
      continue;
    }
    auto content = std::make_shared<Content>();
    content->document = content_->document;
    content->line = adit::line_of(item);
    content->node.reset(item);
    content_->document->sections.push_back(content);
    list.push_back(YamlSection(content));
  }
  return list;
}

void YamlSection::error(std::string_view key, const std::string& message) const {
  content_->error(content_->line_of(key), message);
}

bool YamlSection::ok() const {
  return content_->document->errors.empty();
}

std::string YamlSection::place(std::string_view key) const {
  return content_->document->name + ":" + std::to_string(content_->line_of(key));
}

Result<YamlDocument> YamlDocument::load(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    return Error{ErrorCode::not_found, path + ": cannot be read: " + std::strerror(errno ? errno : ENOENT)};
  }
  return parse(text.str(), path);
}

Result<YamlDocument> YamlDocument::parse(const std::string& text, const std::string& name) {
  auto state = std::make_shared<State>();
  state->name = name;
  try {
    state->root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    return Error{ErrorCode::malformed, name + ":" + std::to_string(e.mark.line + 1) + ": not YAML: " + e.msg};
  }
  if (!state->root.IsMap()) {
    return Error{ErrorCode::malformed, name + ":1: the file must be a mapping (key: value)"};
  }
  return YamlDocument(std::move(state));
}

YamlSection YamlDocument::root() const {
  auto content = std::make_shared<YamlSection::Content>();
  content->document = state_.get();
  content->line = 1;
  content->node.reset(state_->root);
  state_->sections.push_back(content);
  return YamlSection(content);
}

Result<void> YamlDocument::finish() const {
  std::vector<std::pair<int, std::string>> errors = state_->errors;
  // A section may have been read in several places: a key is known when any of them asked for it.
  for (const auto& section : state_->sections) {
    if (!section->node.IsDefined() || !section->node.IsMap()) continue;
    std::set<std::string> known;
    for (const auto& other : state_->sections) {
      if (other->node.IsDefined() && other->node.is(section->node))
        known.insert(other->known.begin(), other->known.end());
    }
    std::string list;
    for (const std::string& key : known) list += (list.empty() ? "" : ", ") + key;
    std::set<std::string> seen;
    for (const auto& entry : section->node) {
      const std::string& key = entry.first.Scalar();
      const int line = line_of(entry.first);
      const auto note = [&](const std::string& message) {
        errors.emplace_back(line, state_->name + ":" + std::to_string(line) + ": " + message);
      };
      if (!known.contains(key)) note("unknown key '" + key + "'; known here: " + list);
      if (!seen.insert(key).second) note("'" + key + "' is given twice");
    }
  }
  std::sort(errors.begin(), errors.end());
  errors.erase(std::unique(errors.begin(), errors.end()), errors.end());
  if (errors.empty()) return {};
  std::string message;
  for (const auto& [line, text] : errors) message += (message.empty() ? "" : "\n") + text;
  return Error{ErrorCode::invalid_argument, message};
}

}  // namespace adit
