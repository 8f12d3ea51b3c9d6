#include "components/runtime/value.hpp"

#include <fmt/core.h>

namespace adit {
namespace {

struct Printer {
  std::string operator()(std::monostate) const { return "null"; }
  std::string operator()(bool value) const { return value ? "true" : "false"; }
  std::string operator()(std::int64_t value) const { return std::to_string(value); }
  std::string operator()(double value) const { return fmt::format("{}", value); }
  std::string operator()(const std::string& value) const { return '"' + value + '"'; }
  std::string operator()(const Value::List& list) const {
    std::string text;
    for (const Value& value : list) text += (text.empty() ? "" : ", ") + to_string(value);
    return '[' + text + ']';
  }
  std::string operator()(const Value::Map& map) const {
    std::string text;
    for (const auto& [key, value] : map) text += (text.empty() ? "" : ", ") + key + ": " + to_string(value);
    return '{' + text + '}';
  }
};

}  // namespace

std::string to_string(const Value& value) {
  return std::visit(Printer{}, value.content);
}

std::string kind_of(const Value& value) {
  static constexpr const char* names[] = {"nothing",  "a bool", "an integer", "a floating-point number",
                                          "a string", "a list", "a map"};
  return names[value.content.index()];
}

}  // namespace adit
