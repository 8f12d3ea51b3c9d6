// The generated C++ of one .idl file.
#pragma once

#include <string>

#include "idl/generator/model.hpp"

namespace adit::generator {

// "sensor_msgs/msg/point_cloud2": the generated files are this plus .hpp, .cpp and _entry.cpp.
std::string output_stem(const Model& model);

std::string header(const Model& model);
// Type information and codec.
std::string source(const Model& model);
// Type-erased operations for the registry.
std::string registry_entry(const Model& model);

}  // namespace adit::generator
