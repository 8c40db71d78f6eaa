// SPDX-License-Identifier: Apache-2.0
// Rays -> texels of one atlas, for one set of directions.
#pragma once

#include <Eigen/Core>
#include <span>

#include "ddgi/constants.h"
#include "ddgi/probe_atlas.h"
#include "ddgi/ray_batch.h"
#include "ddgi/weight_table.h"

namespace probelab {

// What one update does with its result. An average of k updates gives weight 1 / k to this one.
struct BlendMode {
  float hysteresis = 0;     // share of the previous texel
  uint32_t average_of = 1;  // k: position in a running average, 1 restarts it
  bool store_average = false;
};

class BlendStage {
 public:
  // All arguments must outlive the stage. `probe_list` is empty where all probes are updated;
  // `probe_clamps`, the largest distance of each probe in the moments' unit, where all have the
  // same.
  BlendStage(GpuContext& context, const Params& params, const ProbeAtlas& atlas,
             const RayBuffers& rays, const GpuBuffer& probe_list, const GpuBuffer& probe_clamps,
             const GpuBuffer& counters);

  BlendStage(const BlendStage&) = delete;
  BlendStage& operator=(const BlendStage&) = delete;

  // Builds and uploads the weights of these directions.
  void setDirections(std::span<const Vec3f> directions);
  // Blends a batch into copy `target`; `update` numbers the updates (dithering).
  void record(StageRecorder& recorder, const RayItems& items, const BlendMode& mode, int target,
              uint64_t update) const;

  // Products of a weight and a ray, a probe and update; of the directions last set.
  uint64_t productsPerProbe() const { return products_; }

 private:
  GpuContext& context_;
  const Params& params_;
  const ProbeAtlas& atlas_;
  const RayBuffers& rays_;
  Eigen::MatrixXd fit_;
  GpuBuffer block_begin_, block_texels_, entry_rays_, weights_;
  uint32_t blocks_ = 0, ray_count_ = 0;
  uint64_t products_ = 0;
  Stage stage_;
};

}  // namespace probelab
