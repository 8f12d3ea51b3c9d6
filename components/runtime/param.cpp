#include "components/runtime/param.hpp"

#include <fmt/core.h>

#include <cmath>

#include "components/runtime/component.hpp"
#include "components/runtime/component_core.hpp"

namespace adit {
namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::string in_front(const std::string& where) {
  return where.empty() ? "" : where + ": ";
}

}  // namespace

std::string_view symbol(Unit unit) {
  switch (unit) {
    case Unit::none:
      return "";
    case Unit::metre:
      return "m";
    case Unit::millimetre:
      return "mm";
    case Unit::second:
      return "s";
    case Unit::millisecond:
      return "ms";
    case Unit::hertz:
      return "Hz";
    case Unit::radian:
      return "rad";
    case Unit::degree:
      return "deg";
    case Unit::metre_per_second:
      return "m/s";
    case Unit::radian_per_second:
      return "rad/s";
    case Unit::metre_per_second_squared:
      return "m/s^2";
    case Unit::kelvin:
      return "K";
    case Unit::celsius:
      return "degC";
    case Unit::millikelvin:
      return "mK";
    case Unit::pixel:
      return "px";
    case Unit::percent:
      return "%";
    case Unit::byte:
      return "B";
  }
  return "";
}

ParamBase::ParamBase(Component& owner, std::string name, const char* type)
    : core_(owner.core()), name_(std::move(name)), type_(type) {
  core_.add(*this);
}

ParamBase::~ParamBase() {
  core_.remove(*this);
}

ParamInfo ParamBase::info() const {
  return {name_, type_, default_, text(), unit_, range_, choice_names(), description_};
}

Result<void> ParamBase::set(const Value& value) {
  Result<void> result = assign(value);
  if (result) return {};
  return Error{result.error().code, in_front(value.where) + "parameter '" + name_ + "' of " + core_.full_name() + " " +
                                        result.error().message};
}

Error ParamBase::refuse(const std::string& why) const {
  return {ErrorCode::invalid_argument, why};
}

Result<void> ParamBase::check_range(double value) const {
  const std::string unit = unit_ == Unit::none ? "" : " " + std::string(symbol(unit_));
  if (!std::isfinite(value)) return refuse(fmt::format("is {}, but a finite number is wanted", value));
  if (value >= range_.min && value <= range_.max) return {};
  return refuse(fmt::format("is {}{}, outside its range [{}, {}]{}", value, unit, range_.min, range_.max, unit));
}

Result<void> ParamBase::read(const Value& value, double& out) const {
  double number;
  if (const auto* real = std::get_if<double>(&value.content)) {
    number = *real;
  } else if (const auto* integer = std::get_if<std::int64_t>(&value.content)) {
    number = static_cast<double>(*integer);
  } else {
    return refuse("is " + kind_of(value) + " (" + to_string(value) + "), but a number is wanted");
  }
  if (auto checked = check_range(number); !checked) return checked;
  out = number;
  return {};
}

Result<void> ParamBase::read(const Value& value, std::int64_t& out) const {
  const auto* const integer = std::get_if<std::int64_t>(&value.content);
  if (!integer) return refuse("is " + kind_of(value) + " (" + to_string(value) + "), but an integer is wanted");
  if (auto checked = check_range(static_cast<double>(*integer)); !checked) return checked;
  out = *integer;
  return {};
}

Result<void> ParamBase::read(const Value& value, bool& out) const {
  const auto* const boolean = std::get_if<bool>(&value.content);
  if (!boolean) return refuse("is " + kind_of(value) + " (" + to_string(value) + "), but true or false is wanted");
  out = *boolean;
  return {};
}

Result<void> ParamBase::read(const Value& value, std::string& out) const {
  const auto* const text = std::get_if<std::string>(&value.content);
  if (!text) return refuse("is " + kind_of(value) + " (" + to_string(value) + "), but a string is wanted: quote it");
  out = *text;
  return {};
}

Result<std::size_t> ParamBase::read_choice(const Value& value, const std::vector<std::string>& choices) const {
  std::string name;
  if (auto result = read(value, name); !result) return result.error();
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (choices[i] == name) return i;
  }
  return refuse("is \"" + name + "\", but one of these is wanted: " + joined(choices));
}

Result<void> set_parameters(const std::vector<ParamBase*>& params, const Value& values, const std::string& component) {
  struct Walker {
    const std::vector<ParamBase*>& params;
    const std::string& component;

    Result<void> visit(const std::string& name, const Value& value) const {
      for (ParamBase* param : params) {
        if (param->name() == name) return param->set(value);
      }
      if (const auto* map = std::get_if<Value::Map>(&value.content)) return visit_map(name + ".", *map);
      std::vector<std::string> known;
      for (const ParamBase* param : params) known.push_back(param->name());
      return Error{ErrorCode::not_found, in_front(value.where) + component + " has no parameter '" + name +
                                             "'; it has " + (known.empty() ? "none" : joined(known))};
    }
    Result<void> visit_map(const std::string& prefix, const Value::Map& map) const {
      for (const auto& [key, value] : map) {
        if (auto result = visit(prefix + key, value); !result) return result;
      }
      return {};
    }
  };
  if (std::holds_alternative<std::monostate>(values.content)) return {};
  const auto* const map = std::get_if<Value::Map>(&values.content);
  if (!map) {
    return Error{ErrorCode::invalid_argument, in_front(values.where) + "parameters of " + component + " are " +
                                                  kind_of(values) + ", but a map of names to values is wanted"};
  }
  return Walker{params, component}.visit_map("", *map);
}

}  // namespace adit
