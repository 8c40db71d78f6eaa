// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench_baselines.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/timer.h"
#include "ddgi/directions.h"

namespace probelab {
namespace {

constexpr int kQueryRepeats = 2;

// The rays of active probes in update number `update`, as the generate stage makes them.
std::vector<Ray> updateRays(const ProbeField& field, uint64_t update) {
  const std::vector<Vec3f> directions =
      updateDirections(field.params().rays, field.options().seed, update);
  const ProbeStates& states = field.states();
  std::vector<Ray> rays;
  rays.reserve(directions.size() * states.activeCount());
  for (std::size_t probe = 0; probe < states.positions.size(); ++probe) {
    if (states.active[probe] == 0) continue;
    for (const Vec3f& direction : directions)
      rays.push_back({states.positions[probe], 0, direction, kMissDistance});
  }
  return rays;
}

bool isBackFace(const Scene& scene, const Ray& ray, const Hit& hit) {
  const Geometry& g = *scene.geometry;
  const auto& triangle = g.triangles[hit.primitive];
  if (scene.materials[triangle.material].double_sided) return false;
  const Vec3f a = g.positions[triangle.vertex[0]], b = g.positions[triangle.vertex[1]],
              c = g.positions[triangle.vertex[2]];
  return dot(cross(b - a, c - a), ray.direction) > 0;
}

// Radiance and signed distance as the textbook takes them. The radiance, which costs the same
// whatever it is, falls with the distance.
std::vector<Vec4f> textbookRays(const Scene& scene, const EmbreeScene& embree,
                                const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  embree.closest(rays, hits);
  std::vector<Vec4f> data;
  data.reserve(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const float radiance = 1 / (1 + hits[i].t);
    const bool back = hits[i].primitive != kNoHit && isBackFace(scene, rays[i], hits[i]);
    data.emplace_back(radiance, radiance, radiance, back ? -hits[i].t : hits[i].t);
  }
  return data;
}

double medianNs(const std::vector<double>& ms, std::size_t points) {
  return percentile(ms, 0.5) * 1e6 / static_cast<double>(points);
}

}  // namespace

std::vector<double> BaselineTimes::textbook_blend_ms() const {
  std::vector<double> sum = textbook_irradiance_ms;
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += textbook_moments_ms[i];
  return sum;
}

Baselines::Baselines(FieldSetup& setup, std::vector<QueryPoint> points)
    : setup_(setup), points_(std::move(points)), bare_(setup.probeScene()) {
  if (setup.field->layout().interpolant != Interpolant::lattice) {
    why_not_ = "the textbook reads lattices alone";
    return;
  }
  try {
    makeTextbook();
  } catch (const DeviceError& error) {
    why_not_ = error.what();
    textbook_.reset();
  }
}

void Baselines::makeTextbook() {
  const ProbeField& field = *setup_.field;
  const auto rays = static_cast<std::size_t>(field.params().rays);
  TextbookSettings settings;
  settings.rays = static_cast<uint32_t>(rays);
  textbook_.emplace(setup_.gpu, field.layout().lattice, settings);
  const std::vector<Vec4f> of_probes =
      textbookRays(setup_.probeScene(), setup_.probeEmbree(), updateRays(field, 0));
  std::vector<Vec4f> of_points;
  of_points.reserve(textbook_->probeCount() * rays);
  for (std::size_t point = 0; point < textbook_->probeCount(); ++point) {
    const std::size_t probe = point % field.states().activeCount();
    const auto first = of_probes.begin() + static_cast<std::ptrdiff_t>(probe * rays);
    of_points.insert(of_points.end(), first, first + static_cast<std::ptrdiff_t>(rays));
  }
  textbook_->setRays(updateDirections(field.params().rays, field.options().seed, 0), of_points);
}

void Baselines::measure(uint64_t update) {
  times_.bare_ms.push_back(bare_.milliseconds(updateRays(*setup_.field, update)));
  times_.query_ns.push_back(
      medianNs(setup_.field->timeQuery(points_, kQueryRepeats), points_.size()));
  if (!textbook_) return;
  const TextbookBlendTime blend = textbook_->timeBlend(1, 0).front();
  times_.textbook_irradiance_ms.push_back(blend.irradiance_ms);
  times_.textbook_moments_ms.push_back(blend.moments_ms);
  times_.textbook_query_ns.push_back(
      medianNs(textbook_->timeQuery(points_, kQueryRepeats), points_.size()));
}

double Baselines::probeRatio() const {
  return textbook_ ? static_cast<double>(textbook_->probeCount()) /
                         static_cast<double>(setup_.field->states().activeCount())
                   : 1;
}

Json Baselines::textbookJson() const {
  if (!textbook_) return nullptr;
  const TextbookSettings& settings = textbook_->settings();
  return {{"irradiance_texels", settings.irradiance_texels},
          {"moment_texels", settings.moment_texels},
          {"probes", textbook_->probeCount()},
          {"rays", settings.rays}};
}

}  // namespace probelab
