// SPDX-License-Identifier: Apache-2.0
#include "gltf_geometry.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "gltf_accessor.h"

namespace probelab {
namespace {

constexpr std::size_t kMaxVertices = 400'000'000, kMaxTriangles = 400'000'000;
constexpr uint32_t kUnused = 0xffffffffu;

// Attributes of a primitive as the file has them; empty where it has none.
struct Attributes {
  std::vector<float> positions, normals, uv0, uv1;
};

class GeometryBuilder {
 public:
  GeometryBuilder(const GltfFile& gltf, GltfMaterials& materials, Warnings& warnings)
      : gltf_(gltf), materials_(materials), warnings_(warnings) {}

  void addNode(const PlacedNode& placed);
  WorldGeometry take();

 private:
  std::vector<float> attribute(const tinygltf::Primitive& primitive, const char* name,
                               int components, const std::string& element) const;
  Attributes readAttributes(const tinygltf::Primitive& primitive, const std::string& element);
  void checkVertexColors(const tinygltf::Primitive& primitive, const std::string& element);
  void addPrimitive(const PlacedNode& placed, const tinygltf::Primitive& primitive,
                    const std::string& name, const std::string& element);
  void appendVertices(const PlacedNode& placed, const Attributes& from,
                      std::vector<uint32_t>& corners, const std::string& element);

  const GltfFile& gltf_;
  GltfMaterials& materials_;
  Warnings& warnings_;
  WorldGeometry out_;
};

// Corners of triangles, three each, from a primitive's vertex sequence [glTF 2.0, section 3.7.2.1].
std::vector<uint32_t> cornersOf(const std::vector<uint32_t>& v, int mode) {
  std::vector<uint32_t> corners;
  if (mode == TINYGLTF_MODE_TRIANGLES) return v;
  for (std::size_t i = 0; i + 2 < v.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLE_STRIP)
      corners.insert(corners.end(), {v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]});
    else
      corners.insert(corners.end(), {v[i + 1], v[i + 2], v[0]});
  }
  return corners;
}

// Cofactors of the upper 3x3: det(M) times the inverse transpose, which normals transform by.
Mat4d cofactors(const Mat4d& a) {
  Mat4d r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      r.m[i][j] = a.m[i1][j1] * a.m[i2][j2] - a.m[i1][j2] * a.m[i2][j1];
    }
  return r;
}

std::vector<float> GeometryBuilder::attribute(const tinygltf::Primitive& primitive,
                                              const char* name, int components,
                                              const std::string& element) const {
  const auto it = primitive.attributes.find(name);
  if (it == primitive.attributes.end()) return {};
  return readFloats(gltf_, it->second, components, fmt::format("{}, {}", element, name));
}

Attributes GeometryBuilder::readAttributes(const tinygltf::Primitive& primitive,
                                           const std::string& element) {
  Attributes result;
  result.positions = attribute(primitive, "POSITION", 3, element);
  result.normals = attribute(primitive, "NORMAL", 3, element);
  result.uv0 = attribute(primitive, "TEXCOORD_0", 2, element);
  result.uv1 = attribute(primitive, "TEXCOORD_1", 2, element);
  const std::size_t count = result.positions.size() / 3;
  const auto check = [&](const std::vector<float>& values, std::size_t n, const char* name) {
    if (!values.empty() && values.size() != count * n)
      throwInput("{}: {}: has {} values of {} for {} positions", gltf_.path, element,
                 values.size() / n, name, count);
  };
  check(result.normals, 3, "NORMAL");
  check(result.uv0, 2, "TEXCOORD_0");
  check(result.uv1, 2, "TEXCOORD_1");
  checkVertexColors(primitive, element);
  return result;
}

void GeometryBuilder::checkVertexColors(const tinygltf::Primitive& primitive,
                                        const std::string& element) {
  const auto it = primitive.attributes.find("COLOR_0");
  if (it == primitive.attributes.end()) return;
  const int components = componentsOf(gltf_, it->second) == 4 ? 4 : 3;
  const std::vector<float> colors = attribute(primitive, "COLOR_0", components, element);
  for (const float value : colors)
    if (value != 1.0f) {
      warnings_.add("{}: {}: its vertex colours (COLOR_0) are ignored", gltf_.path, element);
      return;
    }
}

void GeometryBuilder::addNode(const PlacedNode& placed) {
  const tinygltf::Node& node = gltf_.model.nodes[placed.node];
  if (node.mesh < 0) return;
  const tinygltf::Mesh& mesh = gltf_.model.meshes[node.mesh];
  const std::string node_name = nodeName(gltf_, placed.node);
  if (node.skin >= 0)
    warnings_.add("{}: {}: its skin is ignored; the mesh stays in its bind pose", gltf_.path,
                  node_name);
  for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
    const std::string mesh_name = elementName("mesh", node.mesh, mesh.name);
    const std::string element = fmt::format("{}, {}, primitive {}", node_name, mesh_name, i);
    const std::string name =
        fmt::format("{} / {} / {}", node.name.empty() ? node_name : printable(node.name),
                    mesh.name.empty() ? mesh_name : printable(mesh.name), i);
    addPrimitive(placed, mesh.primitives[i], name, element);
  }
}

void GeometryBuilder::addPrimitive(const PlacedNode& placed, const tinygltf::Primitive& primitive,
                                   const std::string& name, const std::string& element) {
  const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
  if (mode > TINYGLTF_MODE_TRIANGLE_FAN)
    throwInput("{}: {}: has mode {}, there are 0 to 6", gltf_.path, element, mode);
  if (mode < TINYGLTF_MODE_TRIANGLES) {
    warnings_.add("{}: {}: points and lines are left out", gltf_.path, element);
    return;
  }
  if (!primitive.targets.empty())
    warnings_.add("{}: {}: its morph targets are ignored", gltf_.path, element);
  const Attributes attributes = readAttributes(primitive, element);
  const std::size_t count = attributes.positions.size() / 3;
  std::vector<uint32_t> sequence;
  if (primitive.indices >= 0) {
    sequence = readIndices(gltf_, primitive.indices, element + ", indices");
    for (std::size_t i = 0; i < sequence.size(); ++i)
      if (sequence[i] >= count)
        throwInput("{}: {}: index {} at {} is out of range; there are {} vertices", gltf_.path,
                   element, sequence[i], i, count);
  } else {
    for (std::size_t i = 0; i < count; ++i) sequence.push_back(static_cast<uint32_t>(i));
  }
  std::vector<uint32_t> corners = cornersOf(sequence, mode);
  if (corners.size() % 3 != 0)
    throwInput("{}: {}: has {} corners, which is not a multiple of 3", gltf_.path, element,
               corners.size());
  if (corners.empty()) return;
  const uint32_t material = materials_.use(primitive.material);
  const int uv_set = materials_.highestUvSet(material);
  if ((uv_set == 1 && attributes.uv1.empty()) || (uv_set == 0 && attributes.uv0.empty()))
    warnings_.add("{}: {}: has no TEXCOORD_{}, which its material's texture reads; (0, 0) is taken",
                  gltf_.path, element, uv_set);
  if (out_.triangles.size() + corners.size() / 3 > kMaxTriangles)
    throwInput("{}: {}: the scene has more than {} triangles", gltf_.path, element, kMaxTriangles);
  appendVertices(placed, attributes, corners, element);
  MeshRange range{name, static_cast<uint32_t>(out_.triangles.size()),
                  static_cast<uint32_t>(corners.size() / 3)};
  const bool mirrored = determinant3(placed.to_world) < 0;
  for (std::size_t i = 0; i < corners.size(); i += 3)
    out_.triangles.push_back(
        {{corners[i], corners[i + (mirrored ? 2 : 1)], corners[i + (mirrored ? 1 : 2)]}, material});
  out_.meshes.push_back(std::move(range));
}

// Appends the vertices that `corners` uses, and renumbers it.
void GeometryBuilder::appendVertices(const PlacedNode& placed, const Attributes& from,
                                     std::vector<uint32_t>& corners, const std::string& element) {
  const std::size_t count = from.positions.size() / 3;
  std::vector<uint32_t> new_index(count, kUnused);
  for (const uint32_t corner : corners) new_index[corner] = 0;
  const Mat4d normal_matrix = cofactors(placed.to_world);
  const double side = determinant3(placed.to_world) < 0 ? -1.0 : 1.0;
  const std::size_t base = out_.positions.size();
  if (!from.normals.empty()) out_.normals.resize(base);
  if (!from.uv0.empty()) out_.uv0.resize(base);
  if (!from.uv1.empty()) out_.uv1.resize(base);
  for (std::size_t i = 0; i < count; ++i) {
    if (new_index[i] == kUnused) continue;
    new_index[i] = static_cast<uint32_t>(out_.positions.size());
    const float* p = &from.positions[3 * i];
    const Vec3d world = transformPoint(placed.to_world, {p[0], p[1], p[2]});
    const double largest = std::max({std::abs(world.x), std::abs(world.y), std::abs(world.z)});
    if (!(largest <= kMaxCoordinate))
      throwInput("{}: {}: vertex {} lies at ({}, {}, {}), beyond {} m", gltf_.path, element, i,
                 world.x, world.y, world.z, kMaxCoordinate);
    out_.positions.push_back(world);
    if (!from.normals.empty()) {
      const float* n = &from.normals[3 * i];
      const Vec3d normal = transformVector(normal_matrix, Vec3d(n[0], n[1], n[2]) * side);
      const double size = length(normal);
      out_.normals.push_back(size > 0 && std::isfinite(size) ? Vec3f(normal / size) : Vec3f());
    }
    if (!from.uv0.empty()) out_.uv0.push_back({from.uv0[2 * i], from.uv0[2 * i + 1]});
    if (!from.uv1.empty()) out_.uv1.push_back({from.uv1[2 * i], from.uv1[2 * i + 1]});
  }
  if (out_.positions.size() > kMaxVertices)
    throwInput("{}: {}: the scene has more than {} vertices", gltf_.path, element, kMaxVertices);
  for (uint32_t& corner : corners) corner = new_index[corner];
}

WorldGeometry GeometryBuilder::take() {
  const std::size_t count = out_.positions.size();
  if (!out_.normals.empty()) out_.normals.resize(count);
  if (!out_.uv0.empty()) out_.uv0.resize(count);
  if (!out_.uv1.empty()) out_.uv1.resize(count);
  return std::move(out_);
}

}  // namespace

WorldGeometry buildGeometry(const GltfFile& gltf, const std::vector<PlacedNode>& nodes,
                            GltfMaterials& materials, Warnings& warnings) {
  GeometryBuilder builder(gltf, materials, warnings);
  for (const PlacedNode& node : nodes) builder.addNode(node);
  return builder.take();
}

}  // namespace probelab
