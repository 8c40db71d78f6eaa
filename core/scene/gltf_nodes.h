// SPDX-License-Identifier: Apache-2.0
// The node hierarchy of the default scene, with its animation at one time, as world transforms.
#pragma once

#include <string>
#include <vector>

#include "base/vec.h"
#include "gltf_file.h"

namespace probelab {

// Translation, rotation (unit quaternion x, y, z, w) and scale of a node.
struct NodeTrs {
  Vec3d translation;
  Vec4<double> rotation{0, 0, 0, 1};
  Vec3d scale{1.0};
};

struct PlacedNode {
  int node = -1;  // index into the model's nodes
  Mat4d to_world;
};

// How messages call a node.
std::string nodeName(const GltfFile& gltf, int node);

// Nodes that the default scene reaches, parents before children. Throws InputError for cycles,
// nodes with two parents, and transforms that are not finite, not affine or singular.
std::vector<PlacedNode> placeNodes(const GltfFile& gltf, double time_s, Warnings& warnings);

// Overwrites what the file's animations move at `time_s` (gltf_animation.cpp). `animated`: which
// nodes an animation moves. Times outside a channel's keys take its first or last key.
void animate(const GltfFile& gltf, double time_s, std::vector<NodeTrs>& nodes,
             std::vector<bool>& animated, Warnings& warnings);

// Determinant of the upper 3x3.
double determinant3(const Mat4d& m);

}  // namespace probelab
