// SPDX-License-Identifier: Apache-2.0
// Scenes made in code: rooms, spheres, quads, straight into the Scene struct.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "scene/scene.h"

namespace probelab {

class SceneBuilder {
 public:
  // Returns the material's index.
  uint32_t material(const Vec3f& albedo, const Vec3f& emission = Vec3f(),
                    bool double_sided = false) {
    Material m;
    m.base_color = albedo;
    m.emission = emission;
    m.double_sided = double_sided;
    return material(m);
  }
  uint32_t material(const Material& m) {
    scene_.materials.push_back(m);
    return static_cast<uint32_t>(scene_.materials.size() - 1);
  }
  uint32_t vertex(const Vec3f& p) {
    geometry_.positions.push_back(p);
    return static_cast<uint32_t>(geometry_.positions.size() - 1);
  }
  // Counter-clockwise from the front.
  void triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, uint32_t m) {
    const uint32_t first = vertex(a);
    vertex(b), vertex(c);
    geometry_.triangles.push_back({{first, first + 1, first + 2}, m});
  }
  // Corners counter-clockwise from the front.
  void quad(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, uint32_t m) {
    triangle(a, b, c, m);
    triangle(a, c, d, m);
  }
  // Six quads, fronts outward or (inward = true, a room) towards the inside.
  void box(const Vec3f& lo, const Vec3f& hi, uint32_t m, bool inward) {
    const auto p = [&](int x, int y, int z) {
      return Vec3f(x ? hi.x : lo.x, y ? hi.y : lo.y, z ? hi.z : lo.z);
    };
    const auto face = [&](Vec3f a, Vec3f b, Vec3f c, Vec3f d) {
      inward ? quad(d, c, b, a, m) : quad(a, b, c, d, m);
    };
    face(p(1, 0, 0), p(1, 1, 0), p(1, 1, 1), p(1, 0, 1));
    face(p(0, 0, 0), p(0, 0, 1), p(0, 1, 1), p(0, 1, 0));
    face(p(0, 1, 0), p(0, 1, 1), p(1, 1, 1), p(1, 1, 0));
    face(p(0, 0, 0), p(1, 0, 0), p(1, 0, 1), p(0, 0, 1));
    face(p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1));
    face(p(0, 0, 0), p(0, 1, 0), p(1, 1, 0), p(1, 0, 0));
  }
  // A room with walls of real thickness: inner box facing in, outer box facing out.
  void shell(const Vec3f& lo, const Vec3f& hi, float thickness, uint32_t inner, uint32_t outer) {
    box(lo, hi, inner, true);
    box(lo - Vec3f(thickness), hi + Vec3f(thickness), outer, false);
  }
  // Icosphere; 20 * 4^levels triangles with shared vertices. `smooth` adds vertex normals.
  void sphere(const Vec3f& center, float radius, int levels, uint32_t m, bool inward,
              bool smooth = false) {
    std::vector<Vec3d> points;
    std::vector<std::array<uint32_t, 3>> faces;
    icosahedron(points, faces);
    for (int i = 0; i < levels; ++i) subdivide(points, faces);
    const auto first = static_cast<uint32_t>(geometry_.positions.size());
    for (const Vec3d& p : points) {
      vertex(Vec3f(Vec3d(center) + p * static_cast<double>(radius)));
      if (smooth) {
        geometry_.normals.resize(geometry_.positions.size());
        geometry_.normals.back() = Vec3f(inward ? -p : p);
      }
    }
    for (const auto& f : faces)
      geometry_.triangles.push_back(
          {{first + f[0], first + f[inward ? 2 : 1], first + f[inward ? 1 : 2]}, m});
  }
  void pointLight(const Vec3f& position, const Vec3f& candela) {
    Light light;
    light.name = "light " + std::to_string(scene_.lights.size());
    light.position = position;
    light.intensity = candela;
    scene_.lights.push_back(light);
  }
  void sun(const Vec3f& direction, const Vec3f& lux) {
    Light light;
    light.name = "sun";
    light.type = LightType::directional;
    light.direction = normalize(direction);
    light.intensity = lux;
    scene_.lights.push_back(light);
  }
  void camera(const Vec3f& position, const Vec3f& target) {
    Camera c;
    c.name = "camera " + std::to_string(scene_.cameras.size());
    c.position = position;
    c.forward = normalize(target - position);
    const Vec3f helper = std::abs(c.forward.y) > 0.99f ? Vec3f(1, 0, 0) : Vec3f(0, 1, 0);
    c.up = normalize(cross(cross(c.forward, helper), c.forward));
    scene_.cameras.push_back(c);
  }
  Scene& scene() { return scene_; }
  Geometry& geometry() { return geometry_; }

  // Box, bounds (grown by 1 % of the diagonal) and one state; the builder is then spent.
  Scene finish() {
    if (!geometry_.normals.empty()) geometry_.normals.resize(geometry_.positions.size());
    for (const Triangle& t : geometry_.triangles)
      for (uint32_t v : t.vertex) geometry_.box.extend(geometry_.positions[v]);
    if (scene_.bounds.empty() && !geometry_.triangles.empty()) {
      const Vec3f margin(0.01f * geometry_.box.diagonal());
      scene_.bounds = {geometry_.box.min - margin, geometry_.box.max + margin};
    }
    for (const Light& light : scene_.lights) scene_.light_colors.push_back(light.intensity);
    scene_.path = scene_.name = "built in code";
    scene_.content_hash = "0123456789abcdef0123456789abcdef";
    scene_.states = {LightingState{}};
    scene_.states[0].name = scene_.state = "default";
    scene_.geometry = std::make_shared<const Geometry>(std::move(geometry_));
    return std::move(scene_);
  }

 private:
  static void icosahedron(std::vector<Vec3d>& points, std::vector<std::array<uint32_t, 3>>& faces) {
    const double g = 0.5 * (1 + std::sqrt(5.0));
    for (const Vec3d& p : {Vec3d(-1, g, 0), Vec3d(1, g, 0), Vec3d(-1, -g, 0), Vec3d(1, -g, 0),
                           Vec3d(0, -1, g), Vec3d(0, 1, g), Vec3d(0, -1, -g), Vec3d(0, 1, -g),
                           Vec3d(g, 0, -1), Vec3d(g, 0, 1), Vec3d(-g, 0, -1), Vec3d(-g, 0, 1)})
      points.push_back(normalize(p));
    faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
             {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
             {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  }
  static void subdivide(std::vector<Vec3d>& points, std::vector<std::array<uint32_t, 3>>& faces) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle_of;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto key = std::minmax(a, b);
      const auto [entry, added] =
          middle_of.try_emplace({key.first, key.second}, static_cast<uint32_t>(points.size()));
      if (added) points.push_back(normalize(points[a] + points[b]));
      return entry->second;
    };
    std::vector<std::array<uint32_t, 3>> finer;
    for (const auto& [a, b, c] : faces) {
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    faces = std::move(finer);
  }

  Scene scene_;
  Geometry geometry_;
};

}  // namespace probelab
