// SPDX-License-Identifier: Apache-2.0
// The scene's triangles in Embree (3.13 or 4): closest hits and occlusion for buffers of rays and
// for single ones. Always in robust mode, since the fast mode lets rays slip through shared edges.
// Used by the path tracer, reachability and the field's `embree` tracer.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "scene/scene.h"
#include "shared/ray.h"

namespace probelab {

// Holes of alpha-masked materials are not hit. Back faces are: what they do is the shading's rule.
// Everything is const and may be called from any thread. The tree is the same whatever the number
// of threads, so hits are too.
class EmbreeScene {
 public:
  // Keeps the geometry alive; nothing else of `scene` has to outlive the call. Throws Error when
  // Embree fails.
  explicit EmbreeScene(const Scene& scene);
  ~EmbreeScene();
  EmbreeScene(EmbreeScene&&) noexcept;
  EmbreeScene& operator=(EmbreeScene&&) noexcept;

  // hits[i] belongs to rays[i]; equal lengths. Parallel, in chunks of neighbouring rays. A ray with
  // t_max <= t_min is not traced and misses. Throws NumericalError naming the first ray of a chunk
  // whose origin, direction or interval is not finite (t_max may be infinite): such rays abort
  // Embree, so they never reach it.
  void closest(std::span<const Ray> rays, std::span<Hit> hits) const;
  // 1 where something lies in (t_min, t_max), else 0.
  void occluded(std::span<const Ray> rays, std::span<std::uint32_t> results) const;

  // The same for one ray. Denormals are the caller's matter (FlushDenormals makes it faster).
  Hit closest(const Ray& ray) const;
  bool occluded(const Ray& ray) const;

  // Largest absolute coordinate of the geometry's box, in metres; 0 without triangles. For
  // pointWithoutTriangle of shared/offset.h.
  float extent() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Sets flush-to-zero and denormals-are-zero on this thread while it lives, as Embree recommends.
class FlushDenormals {
 public:
  FlushDenormals();
  ~FlushDenormals();
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned saved_;
};

// "3.13.5": the Embree that this program runs with.
const char* embreeVersion();

}  // namespace probelab
