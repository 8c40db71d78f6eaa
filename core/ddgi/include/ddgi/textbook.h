// SPDX-License-Identifier: Apache-2.0
// The baseline of the speed comparison: probes as [RTXGI] 1.3.7 publishes them. Texels lie in
// images of half floats that the device's texture units filter; an invocation blends one texel over
// all rays of its probe, with a power for every ray and texel; an invocation answers one query
// point from eight probes. Every lattice point stores a probe; there is no relocation or
// classification.
//
// Its results compare with Probelab's: the same octahedral map, radiance^(1/gamma) and moments in
// full where the SDK stores half of each; distances are in metres here.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ddgi/constants.h"
#include "ddgi/layout.h"
#include "gpu/commands.h"
#include "gpu/image.h"
#include "textbook/constants.h"

namespace probelab {

// The SDK's defaults.
struct TextbookSettings {
  uint32_t rays = 256;                                 // a probe
  uint32_t irradiance_texels = 8, moment_texels = 16;  // a side, with the border
  bool full_floats = false;                            // rgba32f and rg32f for rgba16f and rg16f
  bool shared_memory = true;  // stage rays there, where the device has room
  float encoding_gamma = 5;
  float distance_exponent = 50;
  float hysteresis = 0.97f;            // share of the previous texel; 0 for the first write
  float irradiance_threshold = 0.25f;  // a texel that darkens by more forgets faster
  float brightness_threshold = 0.10f;  // one that brightens by more takes a quarter of the step
  float backface_share = 0.1f;         // from this share on the irradiance stays as it is
  float normal_bias_m = 0.1f, view_bias_m = 0.1f;
};

struct TextbookBlendTime {
  double irradiance_ms = 0, moments_ms = 0;
};

class TextbookField {
 public:
  // A field of zeroes. `context` must outlive it. DeviceError when the lattice's images exceed the
  // device's limits: a side of the largest image holds max_image_side / moment_texels probes along
  // x and along z, and max_image_layers along y.
  TextbookField(GpuContext& context, const Lattice& lattice, const TextbookSettings& settings);

  // The rays of the updates that follow. directions: [ray], unit length. rays: [probe][ray],
  // radiance in rgb, in w the distance in metres, negative on a back face; x runs fastest over
  // probes.
  void setRays(std::span<const Vec3f> directions, std::span<const Vec4f> rays);

  // One update of all texels, borders included, by the rays that were set.
  void blend() { timeBlend(1, 0); }
  // The same `repeats` times after `warm_up` updates, with the device's milliseconds of each.
  std::vector<TextbookBlendTime> timeBlend(int repeats, int warm_up = 1);

  // Irradiance at points (1 to 2^20; local coordinates), faded out over one spacing outside.
  std::vector<Vec3f> query(std::span<const QueryPoint> points);
  // Milliseconds on the device of one query of `points`, `repeats` times after a warm-up.
  std::vector<double> timeQuery(std::span<const QueryPoint> points, int repeats);

  // Stored texels, borders included: [probe][texel_y][texel_x], encoded irradiance and moments in
  // metres and square metres.
  std::vector<Vec3f> irradianceTexels();
  std::vector<Vec2f> momentTexels();

  uint32_t probeCount() const { return static_cast<uint32_t>(lattice_.pointCount()); }
  uint64_t atlasBytes() const { return irradiance_.image.bytes() + moments_.image.bytes(); }
  const TextbookSettings& settings() const { return settings_; }

 private:
  struct Atlas {
    GpuImage image;
    ComputePipeline blend;
  };
  // Whole probes whose rays fit in one buffer.
  struct Batch {
    uint32_t first_probe, probe_count;
    GpuBuffer rays;
  };

  Atlas makeAtlas(bool is_irradiance);
  TextbookBlend blendConstants() const;
  void recordBlend(const Atlas& atlas);
  template <class Body>
  void withQuery(std::span<const QueryPoint> points, const Body& body);
  std::vector<uint32_t> texelWords(GpuImage& image, uint32_t side);
  float channel(const uint32_t* texel, uint32_t index) const;

  GpuContext& context_;
  Lattice lattice_;
  TextbookSettings settings_;
  Commands commands_;
  Atlas irradiance_, moments_;
  ComputePipeline query_;
  GpuBuffer directions_;
  std::vector<Batch> batches_;
};

}  // namespace probelab
