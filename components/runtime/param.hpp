// Parameters of a component: typed, with unit and range, set from the deployment before configure().
#pragma once

#include <concepts>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "components/runtime/value.hpp"
#include "idl/result.hpp"

namespace adit {

class Component;
class ComponentCore;

enum class Unit {
  none,
  metre,
  millimetre,
  second,
  millisecond,
  hertz,
  radian,
  degree,
  metre_per_second,
  radian_per_second,
  metre_per_second_squared,
  kelvin,
  celsius,
  millikelvin,
  pixel,
  percent,
  byte
};
std::string_view symbol(Unit unit);  // "m", "s", ...; "" for none

// Both ends belong to it. For a vector parameter it holds for each element.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};

// The values of an enum parameter by the names a deployment writes.
template <class E>
using Choices = std::vector<std::pair<std::string, E>>;

// What documentation and tools list.
struct ParamInfo {
  std::string name;
  std::string type;  // "double", "int64", "bool", "string", "enum", "double[]", ...
  std::string default_value;
  std::string value;
  Unit unit = Unit::none;
  Range range;
  std::vector<std::string> choices;
  std::string description;
};

// Everything of a parameter that does not depend on its type.
class ParamBase {
 public:
  ParamBase(const ParamBase&) = delete;
  ParamBase& operator=(const ParamBase&) = delete;

  const std::string& name() const { return name_; }
  ParamInfo info() const;
  // Wrong type, out of range, unknown choice: an error that says what was given, what is allowed, and where.
  Result<void> set(const Value& value);

 protected:
  ParamBase(Component& owner, std::string name, const char* type);
  ~ParamBase();

  void option(Unit unit) { unit_ = unit; }
  void option(Range range) { range_ = range; }
  void option(std::string_view description) { description_ = description; }

  Result<void> check_range(double value) const;
  Error refuse(const std::string& why) const;
  // Strict, but for an integer where a floating-point number is wanted.
  Result<void> read(const Value& value, double& out) const;
  Result<void> read(const Value& value, std::int64_t& out) const;
  Result<void> read(const Value& value, bool& out) const;
  Result<void> read(const Value& value, std::string& out) const;
  template <class T>
  Result<void> read(const Value& value, std::vector<T>& out) const {
    const auto* const list = std::get_if<Value::List>(&value.content);
    if (!list) return refuse("is " + kind_of(value) + ", but a list is wanted");
    std::vector<T> elements;
    for (const Value& from : *list) {
      T element{};
      if (auto result = read(from, element); !result) return result;
      elements.push_back(std::move(element));
    }
    out = std::move(elements);
    return {};
  }
  Result<std::size_t> read_choice(const Value& value, const std::vector<std::string>& choices) const;

  virtual Result<void> assign(const Value& value) = 0;
  virtual std::string text() const = 0;
  virtual std::vector<std::string> choice_names() const { return {}; }
  void remember_default() { default_ = text(); }

 private:
  ComponentCore& core_;
  const std::string name_;
  const char* const type_;
  Unit unit_ = Unit::none;
  Range range_;
  std::string description_;
  std::string default_;
};

template <class T>
constexpr const char* param_type_name() {
  if constexpr (std::is_same_v<T, double>)
    return "double";
  else if constexpr (std::is_same_v<T, std::int64_t>)
    return "int64";
  else if constexpr (std::is_same_v<T, bool>)
    return "bool";
  else if constexpr (std::is_same_v<T, std::string>)
    return "string";
  else if constexpr (std::is_same_v<T, std::vector<double>>)
    return "double[]";
  else if constexpr (std::is_same_v<T, std::vector<std::int64_t>>)
    return "int64[]";
  else if constexpr (std::is_same_v<T, std::vector<std::string>>)
    return "string[]";
  else if constexpr (std::is_enum_v<T>)
    return "enum";
}

inline Value to_value(double value) {
  return value;
}
inline Value to_value(std::int64_t value) {
  return value;
}
inline Value to_value(bool value) {
  return value;
}
inline Value to_value(const std::string& value) {
  return value;
}
template <class T>
Value to_value(const std::vector<T>& values) {
  Value::List list;
  for (const T& value : values) list.push_back(to_value(value));
  return list;
}

// double, std::int64_t, bool, std::string, or a vector of double, int64 or string. Options after the default, in any
// order: a Unit, a Range, a description. Constant between configure() and cleanup(): read from any thread.
template <class T>
class Param final : public ParamBase {
 public:
  template <class... Options>
  Param(Component& owner, std::string name, T value, const Options&... options)
      : ParamBase(owner, std::move(name), param_type_name<T>()), value_(std::move(value)) {
    (option(options), ...);
    remember_default();
  }
  const T& value() const { return value_; }
  operator const T&() const { return value_; }  // NOLINT: a Param reads like its value

 private:
  Result<void> assign(const Value& value) override { return read(value, value_); }
  std::string text() const override { return to_string(to_value(value_)); }
  T value_;
};

// An enum by name: Param<Method> method_{*this, "method", Method::plain, {{"plain", Method::plain}, ...}}.
template <class T>
requires std::is_enum_v<T>
class Param<T> final : public ParamBase {
 public:
  template <class... Options>
  Param(Component& owner, std::string name, T value, Choices<T> choices, const Options&... options)
      : ParamBase(owner, std::move(name), param_type_name<T>()), value_(value), choices_(std::move(choices)) {
    (option(options), ...);
    remember_default();
  }
  T value() const { return value_; }
  operator T() const { return value_; }  // NOLINT: a Param reads like its value

 private:
  std::vector<std::string> choice_names() const override {
    std::vector<std::string> names;
    for (const auto& choice : choices_) names.push_back(choice.first);
    return names;
  }
  Result<void> assign(const Value& value) override {
    Result<std::size_t> index = read_choice(value, choice_names());
    if (!index) return index.error();
    value_ = choices_[*index].second;
    return {};
  }
  std::string text() const override {
    for (const auto& [name, value] : choices_) {
      if (value == value_) return name;
    }
    return "?";
  }
  T value_;
  Choices<T> choices_;
};

// Sets what `values` (a map; nested maps are names with dots) gives to `params`; an unknown name is an error that lists
// the known ones.
Result<void> set_parameters(const std::vector<ParamBase*>& params, const Value& values, const std::string& component);

}  // namespace adit
