// Components by type name: registered by the code that is linked in or loaded from libadit_component_<type>.so.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "idl/result.hpp"

namespace adit {

class Component;

using ComponentFactory = std::unique_ptr<Component> (*)();

// Made by ADIT_COMPONENT when its library is loaded.
class ComponentRegistration {
 public:
  ComponentRegistration(std::string_view type, ComponentFactory factory);
};

// Thread-safe. A library that was loaded stays loaded.
namespace components {

// A new component of that type; its library is looked for in search_path() when the type is not known yet. The error
// for an unknown type lists the known ones and where they were looked for.
Result<std::unique_ptr<Component>> create(const std::string& type);
// Registered types and those whose libraries are there to be loaded; sorted.
std::vector<std::string> available();
// $ADIT_COMPONENT_PATH (folders separated by ':'), the folder of the program, ../lib and ../lib/adit beside it, and the
// folder of this library.
std::vector<std::string> search_path();

}  // namespace components

}  // namespace adit

// Makes `Class` known as `type_name`. At namespace scope in the component's .cpp file, in the namespace of `Class`.
#define ADIT_COMPONENT(Class, type_name)                                                        \
  static const ::adit::ComponentRegistration adit_component_registration_of_##Class {           \
    type_name, []() -> std::unique_ptr<::adit::Component> { return std::make_unique<Class>(); } \
  }
