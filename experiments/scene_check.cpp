// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "ddgi/directions.h"
#include "scene/init.h"
#include "trace/surface.h"

namespace probelab {
namespace {

// As the default bounds are: a box grown by 1 % of its diagonal, so that the walls are inside.
constexpr double kVolumeMargin = 0.01;

Box3d worldBox(const Scene& scene, const Box3f& box) {
  return {toWorld(scene, box.min), toWorld(scene, box.max)};
}

bool isEmpty(const Box3f& box) {
  return !(box.min.x <= box.max.x && box.min.y <= box.max.y && box.min.z <= box.max.z);
}

// The geometry's box within its outer faces, so that the air around an open building is not part
// of the space that counts; a third of the thinnest wall is cut off. The bounds without walls.
Box3d insideOuterFaces(const Scene& scene, const WallThickness& wall) {
  const Box3d bounds = worldBox(scene, scene.bounds);
  if (!wall.has_walls) return bounds;
  const Box3d box = worldBox(scene, scene.geometry->box);
  const Vec3d cut(static_cast<double>(wall.thinnest_m) / 3);
  return minComponent(box.extent()) > 4 * cut.x ? Box3d{box.min + cut, box.max - cut} : bounds;
}

// What a place sees: the share of front faces says how much it is a room.
struct Outlook {
  double front_faces = 0;  // share of directions
  float nearest_m = 0;
};
Outlook lookAround(const Scene& scene, const EmbreeScene& embree, const Vec3f& place) {
  constexpr int kDirections = 48;
  Outlook outlook{0, std::numeric_limits<float>::infinity()};
  for (const Vec3d& direction : sphericalFibonacci(kDirections)) {
    const Hit hit = embree.closest(Ray{place, 0, Vec3f(direction), 1e18f});
    if (hit.primitive == kNoHit) continue;
    outlook.nearest_m = std::min(outlook.nearest_m, hit.t);
    if (dot(faceNormal(*scene.geometry, hit.primitive), Vec3f(direction)) < 0)
      outlook.front_faces += 1.0 / kDirections;
  }
  return outlook;
}

// The place of an open region that is most like a room: among those that see the most front faces
// the one farthest from any wall.
Vec3f mostEnclosedPlace(const Scene& scene, const EmbreeScene& embree,
                        const Reachability& reachability, int region) {
  constexpr std::size_t kPlaces = 2000;
  std::vector<int> cells;
  for (int cell = 0; cell < static_cast<int>(reachability.cell_region.size()); ++cell)
    if (reachability.cell_region[cell] == region) cells.push_back(cell);
  const std::size_t stride = std::max<std::size_t>(1, cells.size() / kPlaces);
  Vec3f best = reachability.cellCenter(cells[cells.size() / 2]);
  double best_score = -1;
  for (std::size_t i = 0; i < cells.size(); i += stride) {
    const Vec3f place = reachability.cellCenter(cells[i]);
    const Outlook outlook = lookAround(scene, embree, place);
    if (!std::isfinite(outlook.nearest_m)) continue;
    // Enclosure counts in steps of an eighth, so that clearance decides among rooms.
    const double score = std::floor(outlook.front_faces * 8) +
                         static_cast<double>(outlook.nearest_m / (scene.geometry->box.diagonal()));
    if (score > best_score) best_score = score, best = place;
  }
  return best;
}

void warnOfMesh(const MeshReport& mesh, std::vector<std::string>& warnings) {
  const auto open = std::count_if(mesh.meshes.begin(), mesh.meshes.end(),
                                  [](const MeshEdges& edges) { return !edges.closed(); });
  if (mesh.all.boundary_edges > 0)
    warnings.push_back(fmt::format(
        "the geometry is open: {} edges have a triangle on one side only ({} of {} meshes); light "
        "can pass where a wall has no thickness or a gap",
        mesh.all.boundary_edges, open, mesh.meshes.size()));
  if (mesh.all.inconsistent_edges > 0)
    warnings.push_back(
        fmt::format("{} edges join triangles that face opposite ways; back faces are "
                    "black unless doubleSided",
                    mesh.all.inconsistent_edges));
  if (mesh.all.nonmanifold_edges > 0)
    warnings.push_back(
        fmt::format("{} edges are shared by three or more triangles", mesh.all.nonmanifold_edges));
  if (mesh.degenerate_triangles > 0)
    warnings.push_back(
        fmt::format("{} triangles without area were left out", mesh.degenerate_triangles));
  if (mesh.duplicate_triangles > 0)
    warnings.push_back(fmt::format("{} triangles are there twice", mesh.duplicate_triangles));
}

void warnOfLight(const Scene& scene, const SceneFeatures& features,
                 std::vector<std::string>& warnings) {
  if (isUnlit(scene) && !features.sky)
    warnings.push_back(
        "nothing emits light: no light, no emissive material, no sky; 'probelab "
        "init' writes a scene TOML with a sun and a sky");
  constexpr float kLossless = 0.999f;
  for (const Material& material : scene.materials)
    if (maxComponent(material.base_color) * (1 - material.metallic) > kLossless &&
        !material.base_color_texture.used())
      warnings.push_back(
          fmt::format("material '{}' absorbs nothing (albedo 1): bounces settle very slowly, in a "
                      "closed room of it never; lower baseColorFactor",
                      material.name));
  if (scene.cameras.empty())
    warnings.push_back(
        "no camera: add a [[camera]] in a scene TOML, or let 'probelab init' find a "
        "place for one");
}

void warnOfSpace(const Scene& scene, const Reachability& reachability,
                 std::vector<std::string>& warnings) {
  if (!reachability.anchored)
    warnings.push_back(
        "no camera or receiver seed says which space counts; taken are the regions "
        "that do not touch the bounds, or all of them");
  for (const Region& region : reachability.regions)
    if (region.inside_solid)
      for (const uint32_t camera : region.cameras)
        warnings.push_back(
            fmt::format("camera '{}' mostly sees back faces: it is inside a solid, or "
                        "the walls face outward",
                        scene.cameras[camera].name));
}

// The six cells around one, -1 outside the bounds.
std::array<int, 6> neighboursOf(const Reachability& r, int cell) {
  const int nx = r.resolution.x, ny = r.resolution.y, nz = r.resolution.z;
  const int x = cell % nx, y = cell / nx % ny, z = cell / (nx * ny);
  return {x > 0 ? cell - 1 : -1,       x + 1 < nx ? cell + 1 : -1,
          y > 0 ? cell - nx : -1,      y + 1 < ny ? cell + nx : -1,
          z > 0 ? cell - nx * ny : -1, z + 1 < nz ? cell + nx * ny : -1};
}

// The cell of `region` that the most steps from cell to cell separate from any other cell and from
// the bounds; -1 when it has none.
int deepestCell(const Reachability& r, int region) {
  const auto isInside = [&](int cell) { return cell >= 0 && r.cell_region[cell] == region; };
  std::vector<char> seen(r.cell_region.size(), 0);
  std::vector<int> front, next;
  for (int cell = 0; cell < static_cast<int>(r.cell_region.size()); ++cell) {
    if (!isInside(cell)) continue;
    const std::array<int, 6> around = neighboursOf(r, cell);
    if (!std::all_of(around.begin(), around.end(), isInside)) front.push_back(cell), seen[cell] = 1;
  }
  int deepest = -1;
  while (!front.empty()) {
    deepest = front[front.size() / 2];
    next.clear();
    for (const int cell : front)
      for (const int n : neighboursOf(r, cell))
        if (isInside(n) && !seen[n]) seen[n] = 1, next.push_back(n);
    std::sort(next.begin(), next.end());
    front.swap(next);
  }
  return deepest;
}

// The region that is most likely meant; -1 when all space is solid. Regions come by falling size.
int roomRegion(const Reachability& reachability, bool only_sky) {
  constexpr double kSmall = 0.1;  // of the largest region: a closet beside a hall
  const auto& regions = reachability.regions;
  int largest = -1;
  for (int i = 0; i < static_cast<int>(regions.size()); ++i) {
    if (regions[i].inside_solid) continue;
    if (largest < 0) largest = i;
    const double share =
        static_cast<double>(regions[i].cells) / static_cast<double>(regions[largest].cells);
    // Light from the sky alone reaches no region that is closed.
    if (regions[i].touches_bounds == only_sky && share >= kSmall) return i;
  }
  return largest;
}

}  // namespace

SceneCheck checkScene(const Scene& scene, const EmbreeScene& embree) {
  SceneCheck check;
  check.mesh = reportMesh(scene);
  check.features = sceneFeatures(scene);
  check.wall = measureWallThickness(scene, embree);
  check.warnings = scene.warnings;
  warnOfMesh(check.mesh, check.warnings);
  warnOfLight(scene, check.features, check.warnings);
  try {
    check.reachability = findReachable(scene, embree);
    warnOfSpace(scene, *check.reachability, check.warnings);
  } catch (const InputError& error) {
    check.warnings.push_back(error.what());
  }
  check.suggested_volume = suggestVolume(scene, check.reachability, check.wall);
  return check;
}

// The reachable space with its walls; where it runs to the bounds' edge, what lies within the
// outer faces; the bounds where no space is known.
Box3d suggestVolume(const Scene& scene, const std::optional<Reachability>& reachability,
                    const WallThickness& wall) {
  if (!reachability || isEmpty(reachability->reachable_box)) return worldBox(scene, scene.bounds);
  for (const Region& region : reachability->regions)
    if (region.reachable && region.touches_bounds) return insideOuterFaces(scene, wall);
  const Box3d box = worldBox(scene, reachability->reachable_box);
  const Vec3d margin(kVolumeMargin * length(box.max - box.min));
  return {box.min - margin, box.max + margin};
}

std::optional<Vec3f> findCameraPosition(const Scene& scene, const EmbreeScene& embree,
                                        const Reachability& reachability) {
  const int region = roomRegion(reachability, isUnlit(scene));
  if (region < 0) return std::nullopt;
  if (reachability.regions[region].touches_bounds)
    return mostEnclosedPlace(scene, embree, reachability, region);
  const Vec3f middle = toLocal(scene, defaultCameraPosition(scene));
  const int32_t cell = reachability.cellAt(middle);
  if (cell >= 0 && reachability.cell_region[cell] == region) return middle;
  return reachability.cellCenter(deepestCell(reachability, region));
}

}  // namespace probelab
