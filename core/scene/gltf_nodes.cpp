// SPDX-License-Identifier: Apache-2.0
#include "gltf_nodes.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace probelab {
namespace {

// Below this share of the product of its columns' lengths, a determinant is rounding error.
constexpr double kSingular = 1e-12;

Vec3d column(const Mat4d& m, int j) { return {m.m[0][j], m.m[1][j], m.m[2][j]}; }

NodeTrs restTrs(const tinygltf::Node& node) {
  NodeTrs trs;
  const auto& t = node.translation;
  const auto& r = node.rotation;
  const auto& s = node.scale;
  if (t.size() == 3) trs.translation = {t[0], t[1], t[2]};
  if (r.size() == 4) trs.rotation = {r[0], r[1], r[2], r[3]};
  if (s.size() == 3) trs.scale = {s[0], s[1], s[2]};
  return trs;
}

// T R S [glTF 2.0, section 3.5.3]; the quaternion is brought to unit length.
Mat4d matrixOf(const NodeTrs& trs) {
  const Vec4<double>& q = trs.rotation;
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  const double x = q.x / norm, y = q.y / norm, z = q.z / norm, w = q.w / norm;
  const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                          {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                          {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  Mat4d m;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) m.m[i][j] = r[i][j] * trs.scale[j];
    m.m[i][3] = trs.translation[i];
  }
  return m;
}

Mat4d localMatrix(const tinygltf::Node& node, const NodeTrs& trs) {
  if (node.matrix.size() != 16) return matrixOf(trs);
  Mat4d m;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) m.m[i][j] = node.matrix[j * 4 + i];
  return m;
}

void checkMatrix(const GltfFile& gltf, int node, const Mat4d& m, const char* kind) {
  bool finite = true;
  for (const auto& row : m.m)
    for (const double value : row) finite = finite && std::isfinite(value);
  if (!finite)
    throwInput("{}: {}: its {} transform is not finite", gltf.path, nodeName(gltf, node), kind);
  if (m.m[3][0] != 0 || m.m[3][1] != 0 || m.m[3][2] != 0 || m.m[3][3] != 1)
    throwInput("{}: {}: its {} transform is not affine (last row must be 0 0 0 1)", gltf.path,
               nodeName(gltf, node), kind);
  const double size = length(column(m, 0)) * length(column(m, 1)) * length(column(m, 2));
  if (!(std::abs(determinant3(m)) > kSingular * size))
    throwInput("{}: {}: its {} transform is singular; give it a scale that is not 0", gltf.path,
               nodeName(gltf, node), kind);
}

std::vector<int> rootNodes(const GltfFile& gltf, Warnings& warnings) {
  const tinygltf::Model& model = gltf.model;
  if (!model.scenes.empty()) return model.scenes[std::max(model.defaultScene, 0)].nodes;
  std::vector<bool> is_child(model.nodes.size());
  for (const tinygltf::Node& node : model.nodes)
    for (const int child : node.children) is_child[child] = true;
  std::vector<int> roots;
  for (std::size_t i = 0; i < model.nodes.size(); ++i)
    if (!is_child[i]) roots.push_back(static_cast<int>(i));
  if (!model.nodes.empty()) warnings.add("{}: has no scene; all of its nodes are taken", gltf.path);
  return roots;
}

}  // namespace

double determinant3(const Mat4d& m) { return dot(column(m, 0), cross(column(m, 1), column(m, 2))); }

std::string nodeName(const GltfFile& gltf, int node) {
  return elementName("node", node, gltf.model.nodes[node].name);
}

std::vector<PlacedNode> placeNodes(const GltfFile& gltf, double time_s, Warnings& warnings) {
  const std::vector<tinygltf::Node>& nodes = gltf.model.nodes;
  std::vector<NodeTrs> trs;
  for (const tinygltf::Node& node : nodes) trs.push_back(restTrs(node));
  std::vector<bool> animated(nodes.size());
  animate(gltf, time_s, trs, animated, warnings);

  // A stack of our own: the hierarchy may be deeper than the call stack.
  std::vector<PlacedNode> stack, placed;
  const std::vector<int> roots = rootNodes(gltf, warnings);
  for (auto it = roots.rbegin(); it != roots.rend(); ++it) stack.push_back({*it, Mat4d{}});
  std::vector<bool> seen(nodes.size());
  while (!stack.empty()) {
    PlacedNode item = stack.back();
    stack.pop_back();
    const tinygltf::Node& node = nodes[item.node];
    if (seen[item.node])
      throwInput("{}: {}: is reached twice; the node hierarchy must be a tree without cycles",
                 gltf.path, nodeName(gltf, item.node));
    seen[item.node] = true;
    if (animated[item.node] && node.matrix.size() == 16)
      throwInput("{}: {}: is animated and has a matrix; give it translation, rotation and scale",
                 gltf.path, nodeName(gltf, item.node));
    const Mat4d local = localMatrix(node, trs[item.node]);
    checkMatrix(gltf, item.node, local, "local");
    item.to_world = item.to_world * local;
    checkMatrix(gltf, item.node, item.to_world, "world");
    for (auto it = node.children.rbegin(); it != node.children.rend(); ++it)
      stack.push_back({*it, item.to_world});
    placed.push_back(item);
  }
  return placed;
}

}  // namespace probelab
