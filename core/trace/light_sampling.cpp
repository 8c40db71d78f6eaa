// SPDX-License-Identifier: Apache-2.0
#include "trace/light_sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "shared/light.h"
#include "trace/sampling.h"

namespace probelab {
namespace {

// What importance goes by: the largest channel, so that saturated colours are not starved.
float importance(const Vec3f& radiance) { return maxComponent(radiance); }

// Mean importance of a triangle's emission; a texture is sampled on an 8 x 8 grid of its area. A
// triangle whose average misses a bright spot is still found by the cosine samples.
float meanEmission(const Geometry& geometry, const MaterialTable& table, uint32_t triangle) {
  const MaterialData& m = table.materials[geometry.triangles[triangle].material];
  if (importance(m.emission) <= 0) return 0;
  if (m.emission_texture.width == 0) return importance(m.emission);
  constexpr int kGrid = 8;
  float sum = 0;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const Vec2f uv = sampleTriangle({(static_cast<float>(i % kGrid) + 0.5f) / kGrid,
                                     (static_cast<float>(i / kGrid) + 0.5f) / kGrid});
    sum += importance(emissionAt(geometry, table, triangle, uv.x, uv.y));
  }
  return sum / (kGrid * kGrid);
}

// Index of the step of `cdf` (rising, last element the total) that u in [0, total) falls on, and
// what is left of u within the step, in [0, 1).
std::pair<std::size_t, float> pickStep(const double* cdf, std::size_t count, double u) {
  std::size_t i = static_cast<std::size_t>(std::upper_bound(cdf, cdf + count, u) - cdf);
  i = std::min(i, count - 1);
  const double low = i == 0 ? 0.0 : cdf[i - 1], step = cdf[i] - low;
  const double rest = step > 0 ? (u - low) / step : 0.5;
  return {i, static_cast<float>(std::clamp(rest, 0.0, 0x1.fffffep-1))};
}

// Corners in order from the smallest one, so that the front counts, and the material.
using TrianglePlace = std::pair<std::array<std::array<float, 3>, 3>, uint32_t>;
TrianglePlace placeOf(const Geometry& geometry, uint32_t triangle) {
  const Triangle& t = geometry.triangles[triangle];
  TrianglePlace place{{}, t.material};
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3f& p = geometry.positions[t.vertex[i]];
    place.first[i] = {p.x, p.y, p.z};
  }
  std::rotate(place.first.begin(), std::min_element(place.first.begin(), place.first.end()),
              place.first.end());
  return place;
}

}  // namespace

SkySampler::SkySampler(const Sky& sky) : black_(sky.black()) {
  data_.radiance = sky.radiance * sky.scale;
  data_.linear = sky.linear;
  if (black_ || sky.image.empty()) return;
  data_.width = sky.width, data_.height = sky.height;
  const auto w = static_cast<std::size_t>(sky.width), h = static_cast<std::size_t>(sky.height);
  image_.resize(w * h), density_.resize(w * h), column_cdf_.resize(w * h), row_cdf_.resize(h);
  double total = 0;
  for (std::size_t y = 0; y < h; ++y) {
    const double top = std::cos(M_PI * static_cast<double>(y) / static_cast<double>(h));
    const double bottom = std::cos(M_PI * static_cast<double>(y + 1) / static_cast<double>(h));
    const double solid_angle = (top - bottom) * 2 * M_PI / static_cast<double>(w);
    double row = 0;
    for (std::size_t x = 0; x < w; ++x) {
      image_[y * w + x] = sky.image[y * w + x] * sky.scale;
      row += std::max(0.0f, importance(image_[y * w + x])) * solid_angle;
      column_cdf_[y * w + x] = row;
    }
    row_cdf_[y] = total += row;
  }
  if (!(total > 0)) {
    black_ = true;
    return;
  }
  for (std::size_t i = 0; i < w * h; ++i)
    density_[i] = static_cast<float>(std::max(0.0f, importance(image_[i])) / total);
}

Vec3f SkySampler::radiance(const Vec3f& direction) const {
  if (black_) return Vec3f();
  if (data_.width > 0) return image_[static_cast<std::size_t>(skyTexel(data_, direction))];
  return linearSky(data_, direction);
}

Vec3f SkySampler::sample(const Vec2f& u) const {
  if (data_.width > 0) return sampleImage(u);
  return sampleLinear(u);
}

float SkySampler::pdf(const Vec3f& direction) const {
  if (data_.width > 0) return density_[static_cast<std::size_t>(skyTexel(data_, direction))];
  return (1.0f + dot(data_.linear, direction)) / (4.0f * kPi);
}

// Density (1 + b c) / 2 of the cosine c to the axis, b = |linear|; the distribution function
// (1 + c) / 2 + b (c^2 - 1) / 4 is inverted in a form without cancellation at b = 0.
Vec3f SkySampler::sampleLinear(const Vec2f& u) const {
  const float b = length(data_.linear);
  if (!(b > 0)) return sampleSphere(u);
  const float s = 4.0f * u.x - 2.0f + b;
  const float root = std::sqrt(std::max(0.0f, 1.0f + b * s));
  const float c = std::clamp(s / (1.0f + root), -1.0f, 1.0f);
  const float r = std::sqrt(std::max(0.0f, 1.0f - c * c)), phi = 2.0f * kPi * u.y;
  const Frame frame = frameAround(data_.linear / b);
  return frame.x * (r * std::cos(phi)) + frame.y * (r * std::sin(phi)) + frame.z * c;
}

Vec3f SkySampler::sampleImage(const Vec2f& u) const {
  const auto w = static_cast<std::size_t>(data_.width), h = static_cast<std::size_t>(data_.height);
  const auto [y, v] = pickStep(row_cdf_.data(), h, u.y * row_cdf_.back());
  const double* columns = column_cdf_.data() + y * w;
  const auto [x, s] = pickStep(columns, w, u.x * columns[w - 1]);
  const double top = std::cos(M_PI * static_cast<double>(y) / static_cast<double>(h));
  const double bottom = std::cos(M_PI * static_cast<double>(y + 1) / static_cast<double>(h));
  const double c = top + (bottom - top) * static_cast<double>(v);
  const double phi = ((static_cast<double>(x) + s) / static_cast<double>(w) - 0.5) * 2 * M_PI;
  const double r = std::sqrt(std::max(0.0, 1 - c * c));
  return Vec3f(Vec3d(r * std::sin(phi), c, -r * std::cos(phi)));
}

LightSampler::LightSampler(const Geometry& geometry, const MaterialTable& materials, const Sky& sky)
    : geometry_(geometry), materials_(materials), sky_(sky) {
  double total = 0;
  std::vector<double> powers;
  std::map<TrianglePlace, uint32_t> first_at;
  std::vector<std::pair<uint32_t, uint32_t>> copies;  // and what they are copies of
  for (uint32_t i = 0; i < geometry.triangles.size(); ++i) {
    const double power =
        static_cast<double>(meanEmission(geometry, materials, i)) * faceArea(geometry, i);
    if (!(power > 0)) continue;
    // A ray meets one of several triangles in one place, so only one of them may be sampled.
    const auto [first, is_new] = first_at.try_emplace(placeOf(geometry, i), i);
    if (!is_new) {
      copies.emplace_back(i, first->second);
      continue;
    }
    triangles_.push_back(i);
    powers.push_back(power);
    cdf_.push_back(total += power);
  }
  sky_share_ = !sky_.worthSampling() ? 0.0f : (triangles_.empty() ? 1.0f : 0.5f);
  if (triangles_.empty()) return;
  area_pdf_.resize(geometry.triangles.size(), 0.0f);
  for (std::size_t i = 0; i < triangles_.size(); ++i)
    area_pdf_[triangles_[i]] =
        static_cast<float>((1.0 - sky_share_) * powers[i] / total /
                           static_cast<double>(faceArea(geometry, triangles_[i])));
  for (const auto& [copy, original] : copies) area_pdf_[copy] = area_pdf_[original];
}

EmitterSample LightSampler::sample(const Vec3f& x, float choice, const Vec2f& u) const {
  if (choice >= sky_share_) {
    const double rest = (static_cast<double>(choice) - sky_share_) / (1.0 - sky_share_);
    return triangles_.empty() ? EmitterSample() : sampleTriangleAt(x, rest, u);
  }
  EmitterSample result;
  result.direction = sky_.sample(u);
  result.t_max = kFarDistance;
  result.radiance = sky_.radiance(result.direction);
  result.pdf = sky_share_ * sky_.pdf(result.direction);
  return result;
}

EmitterSample LightSampler::sampleTriangleAt(const Vec3f& x, double choice, const Vec2f& u) const {
  const uint32_t index = triangles_[pickStep(cdf_.data(), cdf_.size(), choice * cdf_.back()).first];
  const Triangle& triangle = geometry_.triangles[index];
  const Vec2f uv = sampleTriangle(u);
  const BoundedPoint point = pointOnTriangle(geometry_.positions[triangle.vertex[0]],
                                             geometry_.positions[triangle.vertex[1]],
                                             geometry_.positions[triangle.vertex[2]], uv.x, uv.y);
  const Vec3f normal = faceNormal(geometry_, index);
  const float side = dot(x - point.position, normal);
  if (side <= 0 && !materials_.materials[triangle.material].double_sided) return {};
  // The far end is offset towards x, so that the emitter does not hide itself.
  const Vec3f to_light = offsetOrigin(point, normal, x - point.position) - x;
  const float distance_m = length(to_light);
  if (!(distance_m > 1e-15f)) return {};
  EmitterSample result;
  result.direction = to_light * (1.0f / distance_m);
  const float cosine = std::abs(dot(result.direction, normal));
  if (!(cosine > 0)) return {};
  result.t_max = distance_m * (1.0f - kLightGap);
  result.pdf = trianglePdf(index, distance_m, cosine);
  result.radiance = emissionAt(geometry_, materials_, index, uv.x, uv.y);
  return result;
}

}  // namespace probelab
