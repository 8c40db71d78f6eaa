// SPDX-License-Identifier: Apache-2.0
// Receivers: the points at which fields are scored, and their files. Generated ones lie on
// reachable surfaces (70 %, uniform by area) and in reachable free space (30 %, uniform by volume).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "scene/scene.h"
#include "trace/embree_scene.h"
#include "trace/path_tracer.h"
#include "trace/reachability.h"

namespace probelab {

enum class ReceiverKind : uint32_t { surface, volume, point };  // point: from --points

// Positions in local coordinates (Scene::origin); files hold world coordinates.
struct Receiver {
  Vec3f position, normal, view;  // view: unit, from the camera to the point; -normal without one
  double area = 0;               // weight; surface ones sum to 0.7, volume ones to 0.3
  ReceiverKind kind = ReceiverKind::surface;
  int region = -1;  // of Reachability, -1: none
  Split split = Split::heldout;
  Vec3f a, b;  // field irradiance, two independent halves
};

struct Receivers {
  std::vector<Receiver> points;
  std::string scene_path, scene_hash, state;  // what they belong to
  uint64_t seed = 0;
  uint32_t samples = 0;  // per point; 0: no truth yet
  double rel_error = 0;  // reached
  double seconds = 0;    // of tracing
  uint64_t rays = 0;
  std::string version;  // of the program that wrote them
};

// Positions only. Without triangles all are volume receivers and their weights sum to 1. Throws
// InputError when count is 0 or no reachable place is found.
Receivers generateReceivers(const Scene& scene, const EmbreeScene& embree,
                            const Reachability& reachability, uint32_t count, uint64_t seed);

// x,y,z,nx,ny,nz in world coordinates, one a line, after an optional header; empty lines and lines
// that start with # are skipped. Equal weights, held-out, view = -n. Normals are normalised. Throws
// InputError naming file and line.
Receivers readReceiverPoints(const std::filesystem::path& csv, const Scene& scene,
                             const EmbreeScene& embree, const Reachability& reachability);

// Fills a and b (estimateIrradiance) and the provenance that goes with them.
void traceReceivers(Receivers& receivers, const Scene& scene, const EmbreeScene& embree,
                    const SampleBudget& budget, uint64_t seed,
                    const std::function<void(double)>& progress = {});

// JSON. Reading checks names, types, finite numbers and unit normals, and that the receivers belong
// to this scene (content hash) and state. Throws InputError naming file and element.
void writeReceivers(const std::filesystem::path& path, const Receivers& receivers,
                    const Scene& scene);
Receivers readReceivers(const std::filesystem::path& path, const Scene& scene);

// Train or held-out: by blocks with an edge of 1/16 of the bounds' diagonal, half of them each. It
// does not depend on the seed, so that held-out places stay held-out across seeds.
Split receiverSplit(const Box3f& bounds, const Vec3f& p);
// In 0 .. folds - 1, by the same blocks: for cross-validation within a split.
int receiverFold(const Box3f& bounds, const Vec3f& p, int folds);

const char* receiverKindName(ReceiverKind kind);

}  // namespace probelab
