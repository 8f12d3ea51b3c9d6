#include "components/tunnel_simulator/mesh_import.hpp"

namespace adit::tunnel_simulator {

Result<Mesh> import_mesh(const std::string& path) {
  return Error{ErrorCode::unavailable, path + ": importing maps is not built in"};
}

}  // namespace adit::tunnel_simulator
