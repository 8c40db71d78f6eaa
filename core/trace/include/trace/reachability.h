// SPDX-License-Identifier: Apache-2.0
// Which space counts: the free space of the bounds as voxels, its connected regions, and which of
// them a camera or a receiver seed can reach. Decided from geometry alone. Used by receivers,
// `grid` placement, stored probes and `probelab check`.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.h"
#include "trace/embree_scene.h"

namespace probelab {

// A connected region of free cells.
struct Region {
  uint64_t cells = 0;
  double volume_m3 = 0;  // of its cells; the part of the space that lies in wall cells is missing
  Box3f box;             // of its cells
  bool touches_bounds = false;
  bool inside_solid = false;  // mostly sees back faces of single-sided materials
  bool reachable = false;
  std::vector<uint32_t> cameras, seeds;  // indices into Scene::cameras, Scene::receiver_seeds
};

constexpr int32_t kOccupiedCell = -1;

// Cells are cubes (up to rounding) that fill Scene::bounds exactly; a cell is occupied when a
// triangle touches it (closed boxes, so a wall on a cell's face occupies both sides). Regions come
// in the order of falling cell count.
struct Reachability {
  Box3f bounds;
  Vec3i resolution;                  // cells an axis
  Vec3f cell_size;                   // metres
  std::vector<int32_t> cell_region;  // [z][y][x], kOccupiedCell or the region's index
  std::vector<Region> regions;
  Box3f reachable_box;    // tight box of the reachable free space, to the walls themselves
  bool anchored = false;  // a camera or a seed decided; else the fallbacks of DESIGN did

  int32_t cellAt(const Vec3f& p) const;  // index into cell_region, -1 outside the bounds
  Vec3f cellCenter(int32_t cell) const;
};

// 128 cells along the longest axis; doubled, up to 512 and 32 M cells, while a camera or a seed
// finds no free cell of its own. A gap narrower than two cells may count as closed. Throws
// InputError when the bounds have no volume, or a camera or seed is inside them but in no free
// space.
Reachability findReachable(const Scene& scene, const EmbreeScene& embree);

// Region of a point, -1 when it belongs to none (outside the bounds, enclosed in a solid thinner
// than the cells). A point in an occupied cell belongs to the region of the first free cell that an
// unobstructed ray from it meets; a reachable region is preferred. A point on a surface must be
// lifted off it first.
int regionOf(const Reachability& reachability, const EmbreeScene& embree, const Vec3f& p);
bool isReachable(const Reachability& reachability, const EmbreeScene& embree, const Vec3f& p);

}  // namespace probelab
