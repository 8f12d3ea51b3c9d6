// A world from a file.
#pragma once

#include <string>

#include "components/tunnel_simulator/mesh.hpp"
#include "idl/result.hpp"

namespace adit::tunnel_simulator {

// PLY (ascii or binary little-endian): faces if it has any, else the points as surfels. PCD (ascii or binary): surfels.
// A surfel is a square of the local point spacing, square to the local normal. World coordinates, metres.
Result<Mesh> import_mesh(const std::string& path);

}  // namespace adit::tunnel_simulator
