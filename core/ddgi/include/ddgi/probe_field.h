// SPDX-License-Identifier: Apache-2.0
// A field of irradiance probes on the device: atlases, their update, the query.
//
// One update (DESIGN section 3): generate, trace, shade, occlude, resolve, blend, in batches of
// whole probes. The atlases are double: an update reads the previous field and writes the next, so
// the size of a batch changes no byte.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "ddgi/constants.h"
#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "ddgi/ray_batch.h"

namespace probelab {

struct FieldSettings {
  uint64_t seed = 0;
  TracerKind tracer = TracerKind::automatic;
  uint64_t working_set_bytes = uint64_t{256} << 20;  // of the buffers of one batch
  bool accumulate = true;  // keep running averages (converged mode needs them)
};

// Work that no machine changes, of one update.
struct WorkCounts {
  uint64_t rays = 0, shadow_rays = 0;
  uint64_t texel_ray_products = 0;
  uint64_t resolve_taps = 0;  // texel fetches of all bounce queries, at most
};

// What one update does with its result. An average of k updates gives weight 1 / k to this one.
struct BlendMode {
  float hysteresis = 0;     // share of the previous texel
  uint32_t average_of = 1;  // k: position in a running average, 1 restarts it
  bool store_average = false;
};

class ProbeField {
 public:
  // `scene` may be dropped afterwards; context and embree must outlive the field.
  ProbeField(GpuContext& context, const Scene& scene, const EmbreeScene& embree,
             const ProbeLayout& layout, const Params& params, const FieldSettings& options);

  ProbeField(const ProbeField&) = delete;
  ProbeField& operator=(const ProbeField&) = delete;

  // One update with the directions of rotation number `rotation`. Throws NumericalError when a ray
  // carries a NaN or Inf.
  void update(uint64_t rotation, const BlendMode& irradiance, const BlendMode& moments);

  // The field at points (local coordinates): rgb irradiance, and in w the sum of weights or -1
  // where no probe answered (counted in counters()).
  std::vector<Vec4f> query(std::span<const QueryPoint> points);
  // Milliseconds on the device of one query of `points` (1 to 2^20), `repeats` times after a
  // warm-up.
  std::vector<double> timeQuery(std::span<const QueryPoint> points, int repeats);

  // Camera or other rays: outgoing radiance (rgb) with the signed distance in w, and the field's
  // irradiance at the hit with 1 in w where something reflects. Same lengths as `rays`.
  struct RayResults {
    std::vector<Vec4f> radiance, irradiance;
  };
  RayResults shadeRays(std::span<const Ray> rays);

  // Stored texels decoded to floats, borders included: encoded irradiance
  // [probe][texel_y][texel_x] and moments in units of r_i (empty without visibility).
  std::vector<Vec3f> irradianceTexels();
  std::vector<Vec2f> momentTexels();

  Counters counters() const { return counters_; }  // since construction
  const ProbeLayout& layout() const { return layout_; }
  const Params& params() const { return params_; }
  const FieldSettings& options() const { return options_; }
  const std::string& tracerName() const { return batch_.tracerName(); }
  WorkCounts workOfUpdate() const;
  uint64_t atlasBytes() const;  // one copy of both atlases
  uint32_t probeCount() const { return static_cast<uint32_t>(layout_.positions.size()); }

  // Milliseconds by stage of the last update, and its wall time.
  const std::map<std::string, double>& updateStages() const { return update_stages_; }
  double updateWallMs() const { return update_wall_ms_; }

 private:
  struct Atlas {
    std::array<GpuBuffer, 2> copies;
    GpuBuffer average, weights;
    std::array<Stage, 2> blend;  // [copy that is written]
    Stage make_weights;
  };

  void createAtlas(GpuContext& context, Atlas& atlas, bool is_irradiance);
  void createFieldStages(GpuContext& context);
  void updateBatch(uint32_t first_probe, uint32_t probe_count, const BlendMode& irradiance,
                   const BlendMode& moments);
  void blendAtlas(const Atlas& atlas, const BlendMode& mode, uint32_t first_probe,
                  uint32_t probe_count, bool is_irradiance);
  void readCounters();
  // Runs `body` with the query stage bound to these points, and the buffer that it fills.
  void withQuery(std::span<const QueryPoint> points,
                 const std::function<void(const Stage&, const GpuBuffer&)>& body);
  template <class T>
  std::vector<T> downloadTexels(const Atlas& atlas, int side, uint32_t words,
                                T (*unpack)(int, const uint32_t*), int format);

  GpuContext& context_;
  ProbeLayout layout_;
  Params params_;
  FieldSettings options_;
  uint32_t probes_per_batch_;
  RayBatch batch_;
  StageRecorder recorder_;
  GpuBuffer field_constants_, probe_index_, probe_positions_, directions_, counter_buffer_;
  Atlas irradiance_, moments_;
  int current_ = 0;  // copy of the atlases that holds the field
  Stage generate_;
  std::array<Stage, 2> resolve_, resolve_with_irradiance_, query_;  // [copy read]
  Counters counters_{};
  std::map<std::string, double> update_stages_;
  double update_wall_ms_ = 0;
};

}  // namespace probelab
