// SPDX-License-Identifier: Apache-2.0
#include "trace/reachability.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/rng.h"
#include "shared/light.h"
#include "trace/sampling.h"
#include "trace/surface.h"
#include "voxelize.h"

namespace probelab {
namespace {

constexpr int kBaseCells = 128, kMaxCells = 512;
constexpr double kMaxTotalCells = 32e6;
constexpr int32_t kUnvisited = -2;

// Direction i of n, evenly spread over the sphere (spherical Fibonacci points).
Vec3f fibonacciDirection(int i, int n) {
  const float turn = 0.61803398875f * static_cast<float>(i);
  return sampleSphere(
      {(static_cast<float>(i) + 0.5f) / static_cast<float>(n), turn - std::floor(turn)});
}

Reachability makeGrid(const Scene& scene, int cells) {
  Reachability grid;
  grid.bounds = scene.bounds;
  const Vec3d extent(scene.bounds.extent());
  const double longest = maxComponent(extent);
  double cell = longest / cells;
  const double total = extent.x * extent.y * extent.z / (cell * cell * cell);
  if (total > kMaxTotalCells) cell *= std::cbrt(total / kMaxTotalCells);
  for (std::size_t axis = 0; axis < 3; ++axis)
    grid.resolution[axis] = std::max(1, static_cast<int>(std::lround(extent[axis] / cell)));
  grid.cell_size = Vec3f(extent / Vec3d(grid.resolution));
  const Vec3i n = grid.resolution;
  grid.cell_region.assign(
      static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y) * static_cast<std::size_t>(n.z),
      kUnvisited);
  return grid;
}

void markOccupied(const Geometry& geometry, Reachability& grid) {
  const Vec3i n = grid.resolution;
  const Box3d bounds{Vec3d(grid.bounds.min), Vec3d(grid.bounds.max)};
  for (const Triangle& t : geometry.triangles) {
    throwIfInterrupted();  // large ones touch many cells
    const std::array<Vec3d, 3> corners = {Vec3d(geometry.positions[t.vertex[0]]),
                                          Vec3d(geometry.positions[t.vertex[1]]),
                                          Vec3d(geometry.positions[t.vertex[2]])};
    visitCells(corners, bounds, n, [&](const Vec3i& c) {
      grid.cell_region[static_cast<std::size_t>((c.z * n.y + c.y) * n.x + c.x)] = kOccupiedCell;
    });
  }
}

Vec3i cellCoordinates(const Reachability& grid, int32_t cell) {
  const Vec3i n = grid.resolution;
  return {cell % n.x, cell / n.x % n.y, cell / (n.x * n.y)};
}

// Calls visit(neighbour cell or -1 beyond the bounds, axis, step) for the six neighbours.
template <class Visit>
void forNeighbours(const Reachability& grid, int32_t cell, const Visit& visit) {
  const Vec3i n = grid.resolution, c = cellCoordinates(grid, cell);
  const int32_t stride[3] = {1, n.x, n.x * n.y};
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int step : {-1, 1}) {
      const int at = c[axis] + step;
      visit(at < 0 || at >= n[axis] ? -1 : cell + step * stride[axis], axis, step);
    }
}

Region floodFill(Reachability& grid, int32_t start, int32_t index, std::vector<int32_t>& stack) {
  Region region;
  stack.assign(1, start);
  grid.cell_region[static_cast<std::size_t>(start)] = index;
  while (!stack.empty()) {
    const int32_t cell = stack.back();
    stack.pop_back();
    ++region.cells;
    const Vec3f center = grid.cellCenter(cell);
    region.box.extend(center - grid.cell_size * 0.5f);
    region.box.extend(center + grid.cell_size * 0.5f);
    forNeighbours(grid, cell, [&](int32_t next, std::size_t, int) {
      if (next < 0) {
        region.touches_bounds = true;
      } else if (grid.cell_region[static_cast<std::size_t>(next)] == kUnvisited) {
        grid.cell_region[static_cast<std::size_t>(next)] = index;
        stack.push_back(next);
      }
    });
  }
  region.volume_m3 = static_cast<double>(region.cells) * static_cast<double>(grid.cell_size.x) *
                     static_cast<double>(grid.cell_size.y) * static_cast<double>(grid.cell_size.z);
  return region;
}

void findRegions(Reachability& grid) {
  std::vector<int32_t> stack;
  for (std::size_t i = 0; i < grid.cell_region.size(); ++i)
    if (grid.cell_region[i] == kUnvisited)
      grid.regions.push_back(floodFill(grid, static_cast<int32_t>(i),
                                       static_cast<int32_t>(grid.regions.size()), stack));
  // Largest first; the order of their first cells breaks ties.
  std::vector<int32_t> order(grid.regions.size()), new_index(grid.regions.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
    return grid.regions[static_cast<std::size_t>(a)].cells >
           grid.regions[static_cast<std::size_t>(b)].cells;
  });
  std::vector<Region> sorted;
  for (std::size_t i = 0; i < order.size(); ++i) {
    new_index[static_cast<std::size_t>(order[i])] = static_cast<int32_t>(i);
    sorted.push_back(std::move(grid.regions[static_cast<std::size_t>(order[i])]));
  }
  grid.regions = std::move(sorted);
  for (int32_t& cell : grid.cell_region)
    if (cell >= 0) cell = new_index[static_cast<std::size_t>(cell)];
}

// A region lies in solid geometry when most of what its cells see are black back faces.
void markSolidRegions(const Scene& scene, const EmbreeScene& embree, Reachability& grid) {
  constexpr uint64_t kCells = 16;
  constexpr int kDirections = 12;
  std::vector<uint64_t> seen(grid.regions.size(), 0);
  std::vector<int> backs(grid.regions.size(), 0), rays(grid.regions.size(), 0);
  for (std::size_t i = 0; i < grid.cell_region.size(); ++i) {
    if (grid.cell_region[i] < 0) continue;
    const auto region = static_cast<std::size_t>(grid.cell_region[i]);
    const uint64_t stride = std::max<uint64_t>(1, grid.regions[region].cells / kCells);
    if (seen[region]++ % stride != 0) continue;
    const Vec3f center = grid.cellCenter(static_cast<int32_t>(i));
    for (int k = 0; k < kDirections; ++k) {
      const Vec3f direction = fibonacciDirection(k, kDirections);
      const Hit hit = embree.closest(Ray{center, 0, direction, kFarDistance});
      ++rays[region];
      if (hit.primitive == kNoHit) continue;
      const Material& m = scene.materials[scene.geometry->triangles[hit.primitive].material];
      if (!m.double_sided && dot(faceNormal(*scene.geometry, hit.primitive), direction) > 0)
        ++backs[region];
    }
  }
  for (std::size_t r = 0; r < grid.regions.size(); ++r)
    grid.regions[r].inside_solid = 2 * backs[r] > rays[r];
}

int freeRegionAt(const Reachability& grid, const Vec3f& p) {
  const int32_t cell = grid.cellAt(p);
  return cell < 0 ? -1 : std::max(-1, grid.cell_region[static_cast<std::size_t>(cell)]);
}

// What rays from a point in an occupied cell find.
struct Surroundings {
  int reachable = -1, other = -1;  // region nearest along the rays, of each sort
  Vec3f far_point;                 // in the middle of the longest ray
};

Surroundings lookAround(const Reachability& grid, const EmbreeScene& embree, const Vec3f& p) {
  constexpr int kDirections = 64;
  const float step = 0.5f * minComponent(grid.cell_size);
  const float reach = 16 * maxComponent(grid.cell_size);
  Surroundings found;
  float nearest_reachable = reach, nearest_other = reach, longest = 0;
  for (int k = 0; k < kDirections; ++k) {
    const Vec3f direction = fibonacciDirection(k, kDirections);
    const float end = embree.closest(Ray{p, 0, direction, reach}).t * 0.9999f;
    if (end > longest) longest = end, found.far_point = p + direction * (0.5f * end);
    const float stop = std::min(end, nearest_reachable);
    for (float t = std::min(step, end); t <= stop; t += step) {
      const int region = freeRegionAt(grid, p + direction * t);
      if (region < 0) continue;
      if (grid.regions[static_cast<std::size_t>(region)].reachable)
        nearest_reachable = t, found.reachable = region;
      else if (t < nearest_other)
        nearest_other = t, found.other = region;
      break;
    }
  }
  return found;
}

// Regions of cameras and seeds; false when one inside the bounds has none.
bool anchor(const Scene& scene, const EmbreeScene& embree, Reachability& grid) {
  bool all_found = true;
  const auto find = [&](const Vec3f& p) -> Region* {
    const int region = regionOf(grid, embree, p);
    if (region < 0) all_found = all_found && !grid.bounds.contains(p);
    return region < 0 ? nullptr : &grid.regions[static_cast<std::size_t>(region)];
  };
  for (uint32_t i = 0; i < scene.cameras.size(); ++i)
    if (Region* region = find(scene.cameras[i].position)) region->cameras.push_back(i);
  for (uint32_t i = 0; i < scene.receiver_seeds.size(); ++i)
    if (Region* region = find(scene.receiver_seeds[i])) region->seeds.push_back(i);
  return all_found;
}

void checkSeeds(const Scene& scene, const EmbreeScene& embree, const Reachability& grid) {
  for (std::size_t i = 0; i < scene.receiver_seeds.size(); ++i)
    if (regionOf(grid, embree, scene.receiver_seeds[i]) < 0)
      throwInput(
          "{}: [receivers] seeds, point {}: it is outside [volume] or in no free space; "
          "move it into the room that counts",
          scene.path, i + 1);
}

// DESIGN section 5: what a camera or a seed is in; else what does not touch the bounds; else all.
void decideReachable(Reachability& grid) {
  const auto markWhere = [&](const auto& condition) {
    bool any = false;
    for (Region& region : grid.regions) any |= region.reachable = condition(region);
    return any;
  };
  grid.anchored = markWhere([](const Region& r) { return !r.cameras.empty() || !r.seeds.empty(); });
  if (grid.anchored) return;
  if (markWhere([](const Region& r) { return !r.touches_bounds && !r.inside_solid; })) return;
  if (markWhere([](const Region& r) { return !r.inside_solid; })) return;
  markWhere([](const Region&) { return true; });
}

bool isReachableCell(const Reachability& grid, int32_t cell) {
  const int32_t region = cell < 0 ? -1 : grid.cell_region[static_cast<std::size_t>(cell)];
  return region >= 0 && grid.regions[static_cast<std::size_t>(region)].reachable;
}

// The box's face on one side: the outermost reachable cells' rays along the axis end at the walls.
float reachableFace(const Reachability& grid, const EmbreeScene& embree,
                    const std::vector<int32_t>& border, std::size_t axis, int step,
                    float outermost) {
  const float cell = grid.cell_size[axis], sign = static_cast<float>(step);
  const float bound = step > 0 ? grid.bounds.max[axis] : grid.bounds.min[axis];
  Vec3f direction;
  direction[axis] = sign;
  float face = outermost;
  for (const int32_t i : border) {
    const Vec3f center = grid.cellCenter(i);
    if ((outermost - center[axis]) * sign > 3.5f * cell) continue;  // too far in to matter
    const float limit = std::min(2.5f * cell, (bound - center[axis]) * sign);
    const Hit hit = embree.closest(Ray{center, 0, direction, limit});
    if (hit.primitive == kNoHit && limit < (bound - center[axis]) * sign) continue;
    const float end = center[axis] + sign * (hit.primitive == kNoHit ? limit : hit.t);
    if ((end - face) * sign > 0) face = end;
  }
  return face;
}

Box3f findReachableBox(const Reachability& grid, const EmbreeScene& embree) {
  Box3f box;
  for (const Region& region : grid.regions)
    if (region.reachable) box.extend(region.box.min), box.extend(region.box.max);
  if (box.empty()) return box;
  std::vector<int32_t> border[3][2];
  for (std::size_t i = 0; i < grid.cell_region.size(); ++i) {
    const auto cell = static_cast<int32_t>(i);
    if (!isReachableCell(grid, cell)) continue;
    forNeighbours(grid, cell, [&](int32_t next, std::size_t axis, int step) {
      if (!isReachableCell(grid, next)) border[axis][step > 0 ? 1 : 0].push_back(cell);
    });
  }
  const Box3f cells = box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.min[axis] = reachableFace(grid, embree, border[axis][0], axis, -1, cells.min[axis]);
    box.max[axis] = reachableFace(grid, embree, border[axis][1], axis, 1, cells.max[axis]);
  }
  return box;
}

}  // namespace

int32_t Reachability::cellAt(const Vec3f& p) const {
  if (!bounds.contains(p)) return -1;  // NaN too
  int32_t c[3];
  for (std::size_t axis = 0; axis < 3; ++axis)
    c[axis] = std::clamp(static_cast<int>((p[axis] - bounds.min[axis]) / cell_size[axis]), 0,
                         resolution[axis] - 1);
  return (c[2] * resolution.y + c[1]) * resolution.x + c[0];
}

Vec3f Reachability::cellCenter(int32_t cell) const {
  return bounds.min + cell_size * (Vec3f(cellCoordinates(*this, cell)) + Vec3f(0.5f));
}

Reachability findReachable(const Scene& scene, const EmbreeScene& embree) {
  if (scene.bounds.empty() || !isFinite(scene.bounds.min) || !isFinite(scene.bounds.max) ||
      !(minComponent(scene.bounds.extent()) > 0))
    throwInput("{}: the volume (bounds) is empty in some direction; give [volume] min and max",
               scene.path);
  const FlushDenormals flush;
  for (int cells = kBaseCells;; cells *= 2) {
    Reachability grid = makeGrid(scene, cells);
    markOccupied(*scene.geometry, grid);
    findRegions(grid);
    const bool all_found = anchor(scene, embree, grid);
    if (!all_found && cells < kMaxCells) continue;
    checkSeeds(scene, embree, grid);
    markSolidRegions(scene, embree, grid);
    decideReachable(grid);
    grid.reachable_box = findReachableBox(grid, embree);
    return grid;
  }
}

int regionOf(const Reachability& reachability, const EmbreeScene& embree, const Vec3f& p) {
  if (!reachability.bounds.contains(p)) return -1;
  const int direct = freeRegionAt(reachability, p);
  if (direct >= 0) return direct;
  // In a narrow corner no ray may meet a free cell: go on from the middle of the longest one, which
  // is in the same space.
  Vec3f from = p;
  for (int attempt = 0; attempt < 4; ++attempt) {
    const Surroundings found = lookAround(reachability, embree, from);
    if (found.reachable >= 0) return found.reachable;
    if (found.other >= 0) return found.other;
    from = found.far_point;
  }
  return -1;
}

bool isReachable(const Reachability& reachability, const EmbreeScene& embree, const Vec3f& p) {
  const int region = regionOf(reachability, embree, p);
  return region >= 0 && reachability.regions[static_cast<std::size_t>(region)].reachable;
}

}  // namespace probelab
