// Strict YAML for configuration files: typed access, unknown keys refused, every error with file and line.
#pragma once

#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "idl/result.hpp"

namespace adit {

// A scalar or a flat list as YAML's core schema types it; quoted text is always a string.
using YamlValue = std::variant<bool, std::int64_t, double, std::string, std::vector<bool>, std::vector<std::int64_t>,
                               std::vector<double>, std::vector<std::string>>;

struct YamlRange {
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
};

// One mapping of a document. Getters return the default (or an empty value) when they note an error, so that reading
// goes on and finds the rest; YamlDocument::finish() then fails. A section refers to its document: do not outlive it.
class YamlSection {
 public:
  bool has(std::string_view key) const;
  // The value under `key` is a mapping.
  bool is_section(std::string_view key) const;
  // Keys in the order of the file.
  std::vector<std::string> keys() const;

  // Without a default the key is required. `unit` is for the message only.
  double number(std::string_view key, std::optional<double> otherwise = {}, YamlRange range = {},
                std::string_view unit = "") const;
  // A number that may have a unit ("36 km/h", "100 us", "5 deg": quantity.hpp), in SI units; the range is in these too.
  double quantity(std::string_view key, std::optional<double> otherwise = {}, YamlRange range = {}) const;
  // A list of `count` of them; empty when the key is absent.
  std::vector<double> quantities(std::string_view key, std::size_t count, YamlRange range = {}) const;
  std::int64_t integer(std::string_view key, std::optional<std::int64_t> otherwise = {}, YamlRange range = {}) const;
  bool flag(std::string_view key, std::optional<bool> otherwise = {}) const;
  std::string text(std::string_view key, std::optional<std::string> otherwise = {}) const;
  // One of `allowed`; anything else is an error that lists them.
  std::string choice(std::string_view key, const std::vector<std::string>& allowed,
                     std::optional<std::string> otherwise = {}) const;
  // "1s", "250ms", "2.5min", or a plain number of seconds.
  std::chrono::nanoseconds duration(std::string_view key, std::optional<std::chrono::nanoseconds> otherwise = {}) const;
  std::vector<double> numbers(std::string_view key, std::optional<std::vector<double>> otherwise = {}) const;
  std::vector<std::int64_t> integers(std::string_view key,
                                     std::optional<std::vector<std::int64_t>> otherwise = {}) const;
  std::vector<std::string> texts(std::string_view key, std::optional<std::vector<std::string>> otherwise = {}) const;
  // A scalar or flat list of whatever type it has.
  std::optional<YamlValue> value(std::string_view key) const;

  // The mapping under `key`; an empty section when the key is absent.
  YamlSection section(std::string_view key) const;
  // The list of mappings under `key`; empty when the key is absent.
  std::vector<YamlSection> sections(std::string_view key) const;

  // Notes an error at the key's line (or the section's, when the key is absent or empty).
  void error(std::string_view key, const std::string& message) const;
  // Nothing was noted so far, anywhere in the document. Unknown keys are only found by YamlDocument::finish().
  bool ok() const;
  // "file:line" of the key, or of the section.
  std::string place(std::string_view key = "") const;

 private:
  friend class YamlDocument;
  struct Content;
  explicit YamlSection(std::shared_ptr<Content> content) : content_(std::move(content)) {}
  std::shared_ptr<Content> content_;
};

class YamlDocument {
 public:
  // Fails for a file that cannot be read and for text that is not YAML, or not a mapping.
  static Result<YamlDocument> load(const std::string& path);
  static Result<YamlDocument> parse(const std::string& text, const std::string& name);

  YamlSection root() const;
  // Call when everything was read: an error with all findings, a line each, unknown keys included.
  Result<void> finish() const;

 private:
  struct State;
  friend class YamlSection;
  explicit YamlDocument(std::shared_ptr<State> state) : state_(std::move(state)) {}
  std::shared_ptr<State> state_;
};

}  // namespace adit
