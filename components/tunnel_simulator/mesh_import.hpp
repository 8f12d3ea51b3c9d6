// A world from a file: the map of a real tunnel.
#pragma once

#include <string>

#include "components/tunnel_simulator/mesh.hpp"
#include "idl/result.hpp"

namespace adit::tunnel_simulator {

// PLY (ascii or binary little-endian): its faces if it has any, else its points. PCD (ascii or binary): its points.
// Points become squares of 1.5 voxels in the plane of their neighbourhood, one a voxel, so that rays do not pass
// between them. World coordinates [m]. Malformed files are refused.
Result<Mesh> import_mesh(const std::string& path, double voxel = 0.15);

}  // namespace adit::tunnel_simulator
