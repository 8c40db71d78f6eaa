// SPDX-License-Identifier: Apache-2.0
#include "ddgi/blend_stage.h"

#include "ddgi/texel_fit.h"

namespace probelab {
namespace {

struct BlendPush {
  RayItems items;
  BlendConstants blend;
  uint64_t rays, previous, atlas, average;
  uint32_t probe_total, ray_count;
};
static_assert(sizeof(BlendPush) <= 128);

// Texels that an invocation takes together: as many sums as registers hold.
constexpr int kIrradianceBlock = 4, kMomentBlock = 8;
constexpr int kIrradianceProbes = 4, kMomentProbes = 2;  // that an invocation takes

// Makes room for `data` and copies it there.
template <class T>
void assignArray(GpuContext& context, GpuBuffer& buffer, const std::vector<T>& data) {
  if (buffer.size() < data.size() * sizeof(T))
    buffer = createBuffer(context, data.size() * sizeof(T), MemoryUse::device, buffer.name());
  uploadArray(context, buffer, data);
}

Defines blendDefines(const Params& params, const ProbeAtlas& atlas, bool probe_list,
                     bool probe_clamps) {
  const bool irradiance = atlas.kind == AtlasKind::irradiance;
  const auto flag = [](const char* name, bool on) {
    return std::pair<std::string, std::string>(name, on ? "1" : "0");
  };
  Defines defines = atlasDefines(params);
  defines.insert(defines.end(),
                 {{"PL_BLEND", irradiance ? "0" : "1"},
                  {"PL_BLOCK", std::to_string(irradiance ? kIrradianceBlock : kMomentBlock)},
                  {"PL_PROBES", std::to_string(irradiance ? kIrradianceProbes : kMomentProbes)},
                  {"PL_CHANGE", std::to_string(irradiance ? params.change_detector : 0)},
                  flag("PL_PROBE_LIST", probe_list),
                  flag("PL_PROBE_CLAMP", probe_clamps),
                  flag("PL_ENCODED", irradiance && params.encoding_gamma != 1),
                  flag("PL_ACCUMULATE", static_cast<bool>(atlas.average)),
                  flag("PL_BACKFACE_SKIP", irradiance && params.backface_skip != 0),
                  flag("PL_BACKFACE_FREEZE", irradiance && params.backface_freeze < 1),
                  flag("PL_LINEAR_HISTORY", params.hysteresis_space != 0),
                  flag("PL_DITHER", params.rounding != 0)});
  return defines;
}

}  // namespace

BlendStage::BlendStage(GpuContext& context, const Params& params, const ProbeAtlas& atlas,
                       const RayBuffers& rays, const GpuBuffer& probe_list,
                       const GpuBuffer& probe_clamps, const GpuBuffer& counters)
    : context_(context), params_(params), atlas_(atlas), rays_(rays) {
  const bool irradiance = atlas.kind == AtlasKind::irradiance;
  if (irradiance && params.irradiance_fit != 0) fit_ = bilinearFit(atlas.texels);
  const auto table = [&](const char* name) {
    return createBuffer(context, 64, MemoryUse::device, name);
  };
  block_begin_ = table("block begins"), block_texels_ = table("block texels");
  entry_rays_ = table("entry rays"), weights_ = table("weights");
  std::vector<StageInput> inputs = {{"BLOCK_BEGIN", &block_begin_},
                                    {"BLOCK_TEXELS", &block_texels_},
                                    {"ENTRY_RAYS", &entry_rays_},
                                    {"WEIGHTS", &weights_},
                                    {"COUNTERS", &counters}};
  if (probe_list) inputs.push_back({"PROBE_LIST", &probe_list});
  const bool clamps = !irradiance && probe_clamps;
  if (clamps) inputs.push_back({"PROBE_CLAMPS", &probe_clamps});
  stage_ = makeStage(context, "ddgi/blend.comp.glsl",
                     blendDefines(params, atlas, static_cast<bool>(probe_list), clamps), inputs,
                     sizeof(BlendPush));
}

void BlendStage::setDirections(std::span<const Vec3f> directions) {
  const bool irradiance = atlas_.kind == AtlasKind::irradiance;
  Lobe lobe;
  lobe.texels = atlas_.texels;
  if (!irradiance) lobe.exponent = params_.distance_exponent;
  if (fit_.size() > 0) lobe.fit = &fit_;
  const WeightTable table =
      makeWeightTable(directions, lobe, irradiance ? kIrradianceBlock : kMomentBlock);
  assignArray(context_, block_begin_, table.block_begin);
  assignArray(context_, block_texels_, table.block_texels);
  assignArray(context_, entry_rays_, table.entry_rays);
  assignArray(context_, weights_, table.weights);
  blocks_ = table.blockCount();
  ray_count_ = static_cast<uint32_t>(directions.size());
  products_ = table.weights.size();
}

void BlendStage::record(StageRecorder& recorder, const RayItems& items, const BlendMode& mode,
                        int target, uint64_t update) const {
  const auto real = [](double value) { return static_cast<float>(value); };
  BlendPush push{};
  push.items = items;
  push.blend = {.hysteresis = mode.hysteresis,
                .accumulate = 1.0f / static_cast<float>(mode.average_of),
                .gamma = real(params_.encoding_gamma),
                .backface_freeze = real(params_.backface_freeze),
                .change_threshold = real(params_.change_threshold),
                .change_drop = real(params_.change_drop),
                .reset_threshold = real(params_.reset_threshold),
                .brightness_threshold = real(params_.brightness_threshold),
                .darkening_step = real(params_.darkening_step),
                .store_average = mode.store_average ? 1u : 0u,
                .dither = static_cast<uint32_t>(update),
                .texels = static_cast<uint32_t>(atlas_.texels)};
  const bool irradiance = atlas_.kind == AtlasKind::irradiance;
  push.rays = irradiance ? rays_.radiance.address() : rays_.distances.address();
  push.previous = atlas_.copies[static_cast<std::size_t>(1 - target)].address();
  push.atlas = atlas_.copies[static_cast<std::size_t>(target)].address();
  push.average = atlas_.average ? atlas_.average.address() : 0;
  push.probe_total = static_cast<uint32_t>(atlas_.probes);
  push.ray_count = ray_count_;
  recorder.runGroups(
      "blend", stage_, push, blocks_,
      groupCount(
          items.probe_count,
          kStageGroupSize * static_cast<uint32_t>(irradiance ? kIrradianceProbes : kMomentProbes)));
}

}  // namespace probelab
