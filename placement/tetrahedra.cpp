// SPDX-License-Identifier: GPL-3.0-or-later
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "placement/barycentric.h"
#include "placement/distance.h"

namespace probelab {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Vertex = CGAL::Triangulation_vertex_base_with_info_3<uint32_t, Kernel>;
using Delaunay = CGAL::Delaunay_triangulation_3<
    Kernel,
    CGAL::Triangulation_data_structure_3<Vertex, CGAL::Delaunay_triangulation_cell_base_3<Kernel>>>;

struct ByCoordinates {
  bool operator()(const Vec3f& a, const Vec3f& b) const {
    if (a.x != b.x) return a.x < b.x;
    return a.y != b.y ? a.y < b.y : a.z < b.z;
  }
};

// Distinct positions and, for each, the probes that are there.
struct Sites {
  std::vector<Vec3f> positions;
  std::vector<std::vector<uint32_t>> probes;  // [site]
};

Sites distinctSites(const std::vector<Vec3f>& positions) {
  Sites sites;
  std::map<Vec3f, std::size_t, ByCoordinates> known;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto [entry, added] = known.try_emplace(positions[i], sites.positions.size());
    if (added) sites.positions.push_back(positions[i]), sites.probes.emplace_back();
    sites.probes[entry->second].push_back(static_cast<uint32_t>(i));
  }
  return sites;
}

using SiteWeights = std::vector<std::pair<uint32_t, double>>;  // not negative, sum 1

std::vector<CornerWeight> probeWeights(const Sites& sites, const SiteWeights& weights) {
  std::vector<CornerWeight> result;
  for (const auto& [site, weight] : weights) {
    const auto& probes = sites.probes[site];
    for (const uint32_t probe : probes)
      if (weight > 0)
        result.push_back({probe, static_cast<float>(weight / static_cast<double>(probes.size()))});
  }
  return result;
}

// Negative coordinates are rounding: the point is known to lie inside.
SiteWeights normalized(SiteWeights weights) {
  double sum = 0;
  for (auto& [site, weight] : weights) sum += weight = std::max(0.0, weight);
  if (!(sum > 0)) return {{weights[0].first, 1.0}};
  for (auto& [site, weight] : weights) weight /= sum;
  return weights;
}

double sixVolumes(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
  return dot(b - a, cross(c - a, d - a));
}

SiteWeights inTetrahedron(const Sites& sites, const std::array<uint32_t, 4>& v, const Vec3d& p) {
  std::array<Vec3d, 4> x;
  for (std::size_t i = 0; i < 4; ++i) x[i] = Vec3d(sites.positions[v[i]]);
  const double whole = sixVolumes(x[0], x[1], x[2], x[3]);
  const double sign = whole < 0 ? -1 : 1;
  return normalized({{v[0], sign * sixVolumes(p, x[1], x[2], x[3])},
                     {v[1], sign * sixVolumes(x[0], p, x[2], x[3])},
                     {v[2], sign * sixVolumes(x[0], x[1], p, x[3])},
                     {v[3], sign * sixVolumes(x[0], x[1], x[2], p)}});
}

// `p` on the triangle's plane.
SiteWeights inTriangle(const Sites& sites, const uint32_t (&v)[3], const Vec3d& p) {
  const Vec3d a(sites.positions[v[0]]), b(sites.positions[v[1]]), c(sites.positions[v[2]]);
  const Vec3d normal = cross(b - a, c - a);
  return normalized({{v[0], dot(normal, cross(b - p, c - p))},
                     {v[1], dot(normal, cross(c - p, a - p))},
                     {v[2], dot(normal, cross(a - p, b - p))}});
}

// The hull's triangles, or all triangles of coplanar sites; sites as vertices.
Geometry surfaceTriangles(const Delaunay& delaunay, const Sites& sites) {
  Geometry surface;
  surface.positions = sites.positions;
  const auto add = [&](const Delaunay::Cell_handle& cell, int without) {
    Triangle triangle{};
    for (int i = 0, n = 0; i < 4; ++i)
      if (i != without) triangle.vertex[n++] = cell->vertex(i)->info();
    surface.triangles.push_back(triangle);
  };
  if (delaunay.dimension() == 2) {
    for (auto f = delaunay.finite_facets_begin(); f != delaunay.finite_facets_end(); ++f)
      add(f->first, f->second);
    return surface;
  }
  for (auto f = delaunay.finite_facets_begin(); f != delaunay.finite_facets_end(); ++f)
    if (delaunay.is_infinite(f->first) || delaunay.is_infinite(f->first->neighbor(f->second)))
      add(f->first, f->second);
  return surface;
}

// Collinear sites in the order along their line.
class Chain {
 public:
  explicit Chain(const Sites& sites) : sites_(sites) {
    for (uint32_t i = 0; i < sites.positions.size(); ++i) order_.push_back(i);
    std::sort(order_.begin(), order_.end(), [&](uint32_t a, uint32_t b) {
      return ByCoordinates()(sites.positions[a], sites.positions[b]);
    });
    origin_ = Vec3d(sites.positions[order_.front()]);
    const Vec3d way = Vec3d(sites.positions[order_.back()]) - origin_;
    along_ = length(way) > 0 ? normalize(way) : Vec3d(1, 0, 0);
    for (const uint32_t site : order_)
      places_.push_back(dot(Vec3d(sites.positions[site]) - origin_, along_));
  }
  SiteWeights at(const Vec3d& p) const {
    const double place = dot(p - origin_, along_);
    const auto next = std::upper_bound(places_.begin(), places_.end(), place) - places_.begin();
    const auto i = static_cast<std::size_t>(next);
    if (i == 0) return {{order_.front(), 1.0}};
    if (i == order_.size()) return {{order_.back(), 1.0}};
    const double gap = places_[i] - places_[i - 1];
    const double share = gap > 0 ? (place - places_[i - 1]) / gap : 0;
    return {{order_[i - 1], 1 - share}, {order_[i], share}};
  }

 private:
  const Sites& sites_;
  std::vector<uint32_t> order_;
  std::vector<double> places_;
  Vec3d origin_, along_;
};

// Tetrahedra of the corners inside the hull, one after another: locating changes the
// triangulation's own random numbers. Corners outside stay without one.
std::vector<std::optional<std::array<uint32_t, 4>>> locateAll(const Delaunay& delaunay,
                                                              const Lattice& corners) {
  std::vector<std::optional<std::array<uint32_t, 4>>> result(
      static_cast<std::size_t>(corners.pointCount()));
  if (delaunay.dimension() < 3) return result;
  Delaunay::Cell_handle hint;
  for (std::size_t i = 0; i < result.size(); ++i) {
    const Vec3f p = corners.position(static_cast<int>(i));
    Delaunay::Cell_handle cell = delaunay.locate({p.x, p.y, p.z}, hint);
    hint = cell;
    if (delaunay.is_infinite(cell)) {
      // A point on the hull may be given an infinite cell; the surface answers for it as well.
      continue;
    }
    result[i] = {cell->vertex(0)->info(), cell->vertex(1)->info(), cell->vertex(2)->info(),
                 cell->vertex(3)->info()};
  }
  return result;
}

}  // namespace

CornerWeights barycentricWeights(const Lattice& corners, const std::vector<Vec3f>& positions) {
  PROBELAB_CHECK(!positions.empty());
  const Sites sites = distinctSites(positions);
  std::vector<std::pair<Kernel::Point_3, uint32_t>> points;
  for (std::size_t i = 0; i < sites.positions.size(); ++i) {
    const Vec3f& p = sites.positions[i];
    points.emplace_back(Kernel::Point_3(p.x, p.y, p.z), static_cast<uint32_t>(i));
  }
  const Delaunay delaunay(points.begin(), points.end());
  CornerWeights weights(static_cast<std::size_t>(corners.pointCount()));
  if (delaunay.dimension() < 2) {
    const Chain chain(sites);
    for (std::size_t i = 0; i < weights.size(); ++i)
      weights[i] = probeWeights(sites, chain.at(Vec3d(corners.position(static_cast<int>(i)))));
    return weights;
  }
  const auto tetrahedra = locateAll(delaunay, corners);
  const Geometry surface = surfaceTriangles(delaunay, sites);
  const SceneDistance distance(surface);
  parallelFor(weights.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f p = corners.position(static_cast<int>(i));
      if (tetrahedra[i]) {
        weights[i] = probeWeights(sites, inTetrahedron(sites, *tetrahedra[i], Vec3d(p)));
      } else {
        const ClosestPoint closest = *distance.closest(p);
        weights[i] = probeWeights(
            sites, inTriangle(sites, surface.triangles[closest.triangle].vertex, closest.point));
      }
    }
  });
  return weights;
}

}  // namespace probelab
