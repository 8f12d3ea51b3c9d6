#include "components/tunnel_simulator/mesh_import.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <unordered_map>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace adit::tunnel_simulator {
namespace {

static_assert(std::endian::native == std::endian::little);
constexpr std::size_t kMostElements = 200'000'000;

struct Points {
  std::vector<Eigen::Vector3d> positions;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

// One scalar column of a binary record.
struct Column {
  char kind = 'f';  // f, i, u
  int size = 4;
  double read(const char* data) const {
    const auto as = [&]<class T>(T value) {
      std::memcpy(&value, data, sizeof value);
      return static_cast<double>(value);
    };
    if (kind == 'f') return size == 8 ? as(double{}) : as(float{});
    if (kind == 'i') return size == 1 ? as(std::int8_t{}) : size == 2 ? as(std::int16_t{}) : as(std::int32_t{});
    return size == 1 ? as(std::uint8_t{}) : size == 2 ? as(std::uint16_t{}) : as(std::uint32_t{});
  }
};

bool ply_type(const std::string& name, Column& column) {
  static const std::unordered_map<std::string, Column> kTypes{
      {"char", {'i', 1}},  {"int8", {'i', 1}},    {"uchar", {'u', 1}},  {"uint8", {'u', 1}},
      {"short", {'i', 2}}, {"int16", {'i', 2}},   {"ushort", {'u', 2}}, {"uint16", {'u', 2}},
      {"int", {'i', 4}},   {"int32", {'i', 4}},   {"uint", {'u', 4}},   {"uint32", {'u', 4}},
      {"float", {'f', 4}}, {"float32", {'f', 4}}, {"double", {'f', 8}}, {"float64", {'f', 8}}};
  const auto it = kTypes.find(name);
  if (it == kTypes.end()) return false;
  column = it->second;
  return true;
}

Error malformed(const std::string& path, const std::string& why) {
  return {ErrorCode::malformed, path + ": " + why};
}

// Reads numbers from text or from binary columns alike.
class Values {
 public:
  Values(std::istream& in, bool binary) : in_(in), binary_(binary) {}
  bool next(const Column& column, double& value) {
    if (!binary_) return static_cast<bool>(in_ >> value);
    char bytes[8];
    if (!in_.read(bytes, column.size)) return false;
    value = column.read(bytes);
    return true;
  }

 private:
  std::istream& in_;
  bool binary_;
};

Result<Points> read_ply(std::istream& in, const std::string& path) {
  struct Property {
    std::string name;
    Column column, count;
    bool list = false;
  };
  struct Element {
    std::string name;
    std::size_t count = 0;
    std::vector<Property> properties;
  };
  std::vector<Element> elements;
  bool binary = false;
  bool ended = false;
  std::string line;
  while (!ended && std::getline(in, line)) {
    std::istringstream words(line);
    std::string word, type;
    words >> word;
    if (word == "format") {
      words >> type;
      if (type == "binary_big_endian") return malformed(path, "big-endian PLY is not supported");
      binary = type == "binary_little_endian";
    } else if (word == "element") {
      Element e;
      if (!(words >> e.name >> e.count) || e.count > kMostElements) return malformed(path, "bad element: " + line);
      elements.push_back(e);
    } else if (word == "property") {
      Property p;
      words >> type;
      if (type == "list") {
        std::string count_type;
        p.list = true;
        words >> count_type >> type;
        if (!ply_type(count_type, p.count)) return malformed(path, "unknown type: " + line);
      }
      if (elements.empty() || !ply_type(type, p.column) || !(words >> p.name))
        return malformed(path, "bad property: " + line);
      elements.back().properties.push_back(p);
    } else if (word == "end_header") {
      ended = true;
    }
  }
  if (!ended) return malformed(path, "the header has no end");
  Points out;
  Values values(in, binary);
  for (const Element& e : elements) {
    for (std::size_t i = 0; i < e.count; ++i) {
      Eigen::Vector3d position = Eigen::Vector3d::Zero();
      for (const Property& p : e.properties) {
        double value = 0.0;
        if (!p.list) {
          if (!values.next(p.column, value)) return malformed(path, "ends within element " + e.name);
          if (p.name == "x") position.x() = value;
          if (p.name == "y") position.y() = value;
          if (p.name == "z") position.z() = value;
          continue;
        }
        double count = 0.0;
        if (!values.next(p.count, count) || count < 0.0 || count > 255.0)
          return malformed(path, "bad list in element " + e.name);
        std::array<std::uint32_t, 3> fan{};
        for (int k = 0; k < static_cast<int>(count); ++k) {
          if (!values.next(p.column, value)) return malformed(path, "ends within element " + e.name);
          if (!(value >= 0.0 && value < static_cast<double>(kMostElements)))
            return malformed(path, "a face has an impossible vertex");
          const auto index = static_cast<std::uint32_t>(value);
          if (k < 2) {
            fan[static_cast<std::size_t>(k)] = index;
          } else {
            fan[2] = index;
            if (e.name == "face") out.faces.push_back(fan);
            fan[1] = index;
          }
        }
      }
      if (e.name == "vertex") out.positions.push_back(position);
    }
  }
  return out;
}

Result<Points> read_pcd(std::istream& in, const std::string& path) {
  std::vector<std::string> fields;
  std::vector<Column> columns;
  std::vector<int> counts;
  std::size_t points = 0;
  std::string line, data;
  while (data.empty() && std::getline(in, line)) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    std::string item;
    if (word == "FIELDS") {
      while (words >> item) fields.push_back(item);
      columns.resize(fields.size());
      counts.assign(fields.size(), 1);
    } else if (word == "SIZE" || word == "TYPE" || word == "COUNT") {
      for (std::size_t i = 0; i < columns.size() && words >> item; ++i) {
        if (word == "SIZE") columns[i].size = std::atoi(item.c_str());
        if (word == "TYPE") columns[i].kind = item == "F" ? 'f' : item == "I" ? 'i' : 'u';
        if (word == "COUNT") counts[i] = std::atoi(item.c_str());
      }
    } else if (word == "POINTS") {
      words >> points;
    } else if (word == "DATA") {
      words >> data;
    }
  }
  if (data != "ascii" && data != "binary") return malformed(path, "DATA must be ascii or binary");
  if (points > kMostElements) return malformed(path, "too many points");
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const int s = columns[i].size;
    if ((s != 1 && s != 2 && s != 4 && s != 8) || counts[i] < 1 || counts[i] > 4096)
      return malformed(path, "bad SIZE or COUNT");
  }
  Points out;
  Values values(in, data == "binary");
  for (std::size_t i = 0; i < points; ++i) {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    for (std::size_t f = 0; f < fields.size(); ++f) {
      for (int k = 0; k < counts[f]; ++k) {
        double value = 0.0;
        if (!values.next(columns[f], value)) return malformed(path, "ends within point " + std::to_string(i));
        if (fields[f] == "x") position.x() = value;
        if (fields[f] == "y") position.y() = value;
        if (fields[f] == "z") position.z() = value;
      }
    }
    out.positions.push_back(position);
  }
  return out;
}

// Thins to one point a voxel and puts a square on each, in the plane of its neighbourhood (3 x 3 x 3 voxels).
Mesh surfels(const std::vector<Eigen::Vector3d>& points, double voxel) {
  struct Cell {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
    double count = 0.0;
  };
  const auto key = [](std::int64_t x, std::int64_t y, std::int64_t z) {
    return ((x & 0x1fffff) << 42) | ((y & 0x1fffff) << 21) | (z & 0x1fffff);
  };
  const auto index = [&](double v) { return static_cast<std::int64_t>(std::floor(v / voxel)); };
  std::unordered_map<std::int64_t, Cell> cells;
  std::vector<std::array<std::int64_t, 3>> order;  // of first sight: the mesh must not depend on hashing
  for (const Eigen::Vector3d& p : points) {
    const std::array<std::int64_t, 3> i{index(p.x()), index(p.y()), index(p.z())};
    Cell& c = cells[key(i[0], i[1], i[2])];
    if (c.count == 0.0) order.push_back(i);
    c.sum += p;
    c.square += p * p.transpose();
    c.count += 1.0;
  }
  Mesh mesh;
  const std::uint32_t surface = mesh.add_surface({Material::concrete, false, 0.0F, 1.0F});
  for (const auto& i : order) {
    Cell around;
    for (std::int64_t dx = -1; dx <= 1; ++dx) {
      for (std::int64_t dy = -1; dy <= 1; ++dy) {
        for (std::int64_t dz = -1; dz <= 1; ++dz) {
          const auto it = cells.find(key(i[0] + dx, i[1] + dy, i[2] + dz));
          if (it == cells.end()) continue;
          around.sum += it->second.sum;
          around.square += it->second.square;
          around.count += it->second.count;
        }
      }
    }
    if (around.count < 4.0) continue;
    const Eigen::Vector3d mean = around.sum / around.count;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> plane(around.square / around.count - mean * mean.transpose());
    const Cell& own = cells[key(i[0], i[1], i[2])];
    const Eigen::Vector3d centre = own.sum / own.count;
    const Eigen::Vector3d a = 0.75 * voxel * plane.eigenvectors().col(1);
    const Eigen::Vector3d b = 0.75 * voxel * plane.eigenvectors().col(2);
    mesh.add_quad(centre - a - b, centre + a - b, centre + a + b, centre - a + b, surface);
  }
  return mesh;
}

}  // namespace

Result<Mesh> import_mesh(const std::string& path, double voxel) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return Error{ErrorCode::not_found, path + ": cannot be read"};
  std::string first;
  std::getline(in, first);
  const bool ply = first.rfind("ply", 0) == 0;
  auto points = ply ? read_ply(in, path) : read_pcd(in, path);
  if (!points) return points.error();
  for (const Eigen::Vector3d& p : points->positions) {
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > 5e4)
      return malformed(path, "a point is not finite or farther than 50 km from the origin");
  }
  if (points->positions.empty()) return malformed(path, "has no points");
  if (points->faces.empty()) return surfels(points->positions, voxel);
  Mesh mesh;
  const std::uint32_t surface = mesh.add_surface({Material::concrete, false, 0.0F, 1.0F});
  for (const Eigen::Vector3d& p : points->positions) mesh.vertices.push_back({p});
  for (const auto& f : points->faces) {
    if (*std::max_element(f.begin(), f.end()) >= mesh.vertices.size())
      return malformed(path, "a face names a vertex that is not there");
    mesh.triangles.push_back({f[0], f[1], f[2], surface});
  }
  return mesh;
}

}  // namespace adit::tunnel_simulator
