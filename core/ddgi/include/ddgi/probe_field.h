// SPDX-License-Identifier: Apache-2.0
// A field of irradiance probes on the device: atlases, their update, the query.
//
// One update (DESIGN section 3): generate, trace, shade, occlude, resolve, blend, in batches of
// whole probes. The atlases are double: an update reads the previous field and writes the next, so
// the size of a batch changes no byte.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "ddgi/blend_stage.h"
#include "ddgi/constants.h"
#include "ddgi/field_constants.h"
#include "ddgi/layout.h"
#include "ddgi/params.h"
#include "ddgi/probe_atlas.h"
#include "ddgi/probe_states.h"
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

// What went wrong so far, and how queries were answered where the weights of the cell's probes gave
// no answer (shared/query_params.h).
struct Counters {
  uint32_t non_finite_rays = 0;   // radiance that is NaN or Inf
  uint32_t clamped_texels = 0;    // beyond the format's largest number
  uint32_t tiny_weight_sums = 0;  // queries with a sum of weights below kTinyWeightSum
  uint32_t fallback_queries = 0;  // the next three together
  uint32_t unoccluded_answers = 0, nearest_answers = 0, empty_answers = 0;
};

// What a stage needs to query the field: what to specialise to, buffers bound by name, addresses in
// its push constants (valid until the next update).
struct FieldAccess {
  LayoutUse layout;
  std::vector<StageInput> inputs;
  FieldAddresses addresses;
};

class ProbeField {
 public:
  // Relocates and classifies the probes first, as the parameters say. `scene` may be dropped
  // afterwards; context and embree must outlive the field. Throws InputError when no probe is left
  // active.
  ProbeField(GpuContext& context, const Scene& scene, const EmbreeScene& embree,
             const ProbeLayout& layout, const Params& params, const FieldSettings& options);

  ProbeField(const ProbeField&) = delete;
  ProbeField& operator=(const ProbeField&) = delete;

  // One update with the directions of rotation number `rotation`. Throws NumericalError when a ray
  // carries a NaN or Inf; the texels are then those before it.
  void update(uint64_t rotation, const BlendMode& irradiance, const BlendMode& moments);

  // The field at points (local coordinates): rgb irradiance, and in w the sum of weights or -1
  // where the probes' weights gave no answer (counted in counters()). Normals of any length; a
  // point that is not finite or has no normal gets 0 and counts as an empty answer.
  std::vector<Vec4f> query(std::span<const QueryPoint> points);
  // Milliseconds on the device of one query of `points` (1 to 2^20), `repeats` times after a
  // warm-up.
  std::vector<double> timeQuery(std::span<const QueryPoint> points, int repeats);

  // Stored texels decoded to floats, [probe][y][x] with the border if there is one: encoded
  // irradiance, and mean and mean square of the distance in units of r_i (empty without
  // visibility).
  std::vector<Vec3f> irradianceTexels();
  std::vector<Vec2f> momentTexels();
  // Replaces the irradiance texels: the same order and encoding, rounded to nearest in the format,
  // the border's as given. Queries read them until the next update, which blends them into its own;
  // running averages do not know them. Throws NumericalError naming the probe of one that is
  // negative or not finite; those beyond the format's largest number count as clamped.
  void setIrradianceTexels(std::span<const Vec3f> texels);

  // Mean over texels of active probes that are not black of the last update's coefficient of
  // variation of the stored values (shaders/ddgi/probe_stats.comp.glsl); 1 while all are black.
  // Kept where the parameters use it.
  double variability() const { return variability_; }

  Counters counters() const { return counters_; }  // since construction
  const ProbeLayout& layout() const { return layout_; }
  const ProbeStates& states() const { return states_; }
  const Params& params() const { return params_; }
  const FieldSettings& options() const { return options_; }
  const std::string& tracerName() const { return batch_.tracerName(); }
  WorkCounts workOfUpdate() const;  // of the last update, or the first to come
  uint64_t atlasBytes() const;      // one copy of both atlases
  uint64_t stateBytes() const;      // positions, lengths and index
  uint32_t probeCount() const { return static_cast<uint32_t>(layout_.positions.size()); }

  // Milliseconds by stage of the last update, and its wall time; the same of relocation and
  // classification.
  const std::map<std::string, double>& updateStages() const { return update_stages_; }
  double updateWallMs() const { return update_wall_ms_; }
  const std::map<std::string, double>& stateStages() const { return state_stages_; }

  FieldAccess access() const;
  void readCounters();  // after stages that others ran

 private:
  // Point i of the lattice is probe i, for all: then the query needs no index.
  bool pointsAreProbes() const;

  // Directions that some of the probes share, with the stages that are bound to them.
  struct RaySet {
    int rays = 0;
    GpuBuffer directions;
    Stage generate;
    std::unique_ptr<BlendStage> irradiance, moments;
  };

  // Whether a probe is bright and flat enough for fewer rays, and how often that has changed.
  struct FlatState {
    bool is_flat = false;
    int changes = 0;
  };

  void createStates(GpuContext& context);
  void createIndex(GpuContext& context);
  std::unique_ptr<RaySet> createRaySet(GpuContext& context, int rays);
  void createFieldStages(GpuContext& context);
  void setDirections(RaySet& set, uint64_t rotation);
  void updateProbes(const RaySet& set, uint32_t first, uint32_t count, const BlendMode& irradiance,
                    const BlendMode& moments);
  void measureProbes();
  void chooseFlatProbes(std::span<const Vec4f> stats, double mean);
  bool usesProbeList() const;

  GpuContext& context_;
  ProbeLayout layout_;
  Params params_;
  FieldSettings options_;
  uint32_t rays_per_batch_;
  RayBatch batch_;
  StageRecorder recorder_;
  ProbeStates states_;
  bool moved_ = false;
  std::map<std::string, double> state_stages_;
  GpuBuffer field_constants_, nearest_probe_, probe_positions_, probe_list_;
  GpuBuffer probe_index_;                                    // of a lattice
  GpuBuffer voxel_begin_, entries_, places_, probe_clamps_;  // of scattered probes
  bool walls_ = false;  // that divide voxels
  GpuBuffer plane_of_voxel_, planes_;
  double probes_per_query_ = 8;                              // mean over the places
  GpuBuffer counter_buffer_, stats_buffer_;
  ProbeAtlas irradiance_, moments_;
  int current_ = 0;  // copy of the atlases that holds the field
  std::unique_ptr<RaySet> full_, reduced_;
  uint32_t full_count_ = 0, reduced_count_ = 0;  // probes of each set, in probe_list_'s order
  std::vector<FlatState> flat_states_;           // [probe]
  Stage resolve_, query_, stats_;
  uint64_t updates_ = 0;
  double variability_ = 1;
  Counters counters_{};
  uint32_t refused_queries_ = 0;  // of points that are none; the device never sees them
  uint32_t clamped_uploads_ = 0;  // by setIrradianceTexels; the device does not count them
  std::map<std::string, double> update_stages_;
  double update_wall_ms_ = 0;
};

}  // namespace probelab
