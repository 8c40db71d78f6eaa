// SPDX-License-Identifier: Apache-2.0
#include "ddgi/probe_field.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "base/timer.h"
#include "ddgi/directions.h"
#include "ddgi/texels.h"

namespace probelab {
namespace {

struct CountPush {
  uint32_t item_count;
};
struct GeneratePush {
  uint32_t item_count, first_probe, ray_count;
};
struct WeightsPush {
  uint32_t item_count, texels;
  float exponent;
};
struct BlendPush {
  uint32_t texels;
  BlendConstants blend;
};
struct FieldConstants {
  LatticeShape lattice;
  QueryParams<float> query;
  DistanceRule distance;
};
constexpr uint32_t kProbesPerGroup = 8;  // of blend.comp.glsl
constexpr uint32_t kQueryChunk = 1u << 20;

Defines queryDefines(const Params& params) {
  const auto number = [](const char* name, int value) {
    return std::pair<std::string, std::string>(name, std::to_string(value));
  };
  const QueryModes modes = queryModes(params);
  return {number("PL_FACING", modes.facing),
          number("PL_TRILINEAR", modes.trilinear),
          number("PL_VISIBILITY", modes.visibility),
          number("PL_CRUSH", modes.crush),
          number("PL_AVERAGE", modes.average),
          number("PL_FALLBACK", modes.fallback),
          number("PL_IRRADIANCE_FORMAT", params.irradiance_format),
          number("PL_MOMENT_FORMAT", params.moment_format)};
}

// Probes a batch holds: the working set and the largest buffer bound its rays.
uint32_t probesPerBatch(const GpuContext& context, const Scene& scene, const Params& params,
                        const ProbeLayout& layout, const FieldSettings& options) {
  const uint64_t rays = static_cast<uint64_t>(params.rays);
  const uint64_t by_set = options.working_set_bytes / rayBytes(!scene.lights.empty());
  const uint64_t by_range = context.info().max_storage_buffer_range / sizeof(RaySurface);
  const uint64_t probes = std::max<uint64_t>(std::min(by_set, by_range) / rays, 1);
  return static_cast<uint32_t>(std::min<uint64_t>(probes, layout.positions.size()));
}

GpuBuffer uploadConstants(GpuContext& context, const ProbeLayout& layout, const Params& params) {
  const FieldConstants constants{
      latticeShape(layout, params),
      convertQueryParams<float>(queryParams(params)),
      {1.0f / layout.support_radius_m, static_cast<float>(params.distance_clamp),
       static_cast<float>(params.backface_shortening)}};
  return createBufferFrom(context, std::span<const FieldConstants>(&constants, 1),
                          MemoryUse::device, "field constants");
}

}  // namespace

ProbeField::ProbeField(GpuContext& context, const Scene& scene, const EmbreeScene& embree,
                       const ProbeLayout& layout, const Params& params,
                       const FieldSettings& options)
    : context_(context),
      layout_((validateParams(params), validateLayout(layout, params), layout)),
      params_(params),
      options_(options),
      probes_per_batch_(probesPerBatch(context, scene, params, layout, options)),
      batch_(context, scene, embree, options.tracer,
             probes_per_batch_ * static_cast<uint32_t>(params.rays)),
      recorder_(context),
      field_constants_(uploadConstants(context, layout, params)),
      probe_index_(
          createBufferFrom(context, layout.probe_of_point, MemoryUse::device, "probe index")),
      probe_positions_(
          createBufferFrom(context, layout.positions, MemoryUse::device, "probe positions")),
      directions_(createBuffer(context, sizeof(Vec3f) * static_cast<uint64_t>(params.rays),
                               MemoryUse::device, "directions")),
      counter_buffer_(createBuffer(context, sizeof(Counters), MemoryUse::device, "counters")) {
  createAtlas(context, irradiance_, true);
  if (params.visibility != 0) createAtlas(context, moments_, false);
  createFieldStages(context);
}

void ProbeField::createAtlas(GpuContext& context, Atlas& atlas, bool is_irradiance) {
  const uint64_t side =
      static_cast<uint64_t>(is_irradiance ? params_.irradiance_texels : params_.moment_texels);
  const uint64_t words = is_irradiance ? irradianceWords(params_.irradiance_format)
                                       : momentWords(params_.moment_format);
  const uint64_t interior = (side - 2) * (side - 2);
  const std::string name = is_irradiance ? "irradiance" : "moments";
  for (auto& copy : atlas.copies)
    copy = createBuffer(context, probeCount() * side * side * words * 4, MemoryUse::device,
                        name + " atlas");
  if (options_.accumulate)
    atlas.average = createBuffer(context, probeCount() * interior * sizeof(Vec3f),
                                 MemoryUse::device, name + " average");
  atlas.weights =
      createBuffer(context, interior * static_cast<uint64_t>(params_.rays) * sizeof(float),
                   MemoryUse::device, name + " weights");
  atlas.make_weights =
      makeStage(context, "ddgi/weights.comp.glsl", {{"PL_LOBE", is_irradiance ? "0" : "1"}},
                {{"DIRECTIONS", &directions_}, {"WEIGHTS", &atlas.weights}}, sizeof(WeightsPush));
  Defines defines = queryDefines(params_);
  defines.emplace_back("PL_BLEND", is_irradiance ? "0" : "1");
  defines.emplace_back("PL_ACCUMULATE", options_.accumulate ? "1" : "0");
  const RayBuffers& rays = batch_.buffers();
  std::vector<StageInput> inputs = {is_irradiance ? StageInput{"RADIANCE", &rays.radiance}
                                                  : StageInput{"DISTANCES", &rays.distances},
                                    {"WEIGHTS", &atlas.weights},
                                    {"PREVIOUS", &atlas.copies[1]},
                                    {"ATLAS", &atlas.copies[0]},
                                    {"COUNTERS", &counter_buffer_}};
  if (atlas.average) inputs.push_back({"AVERAGE", &atlas.average});
  atlas.blend[0] = makeStage(context, "ddgi/blend.comp.glsl", defines, inputs, sizeof(BlendPush));
  atlas.blend[1] = atlas.blend[0].with("PREVIOUS", atlas.copies[0]).with("ATLAS", atlas.copies[1]);
}

void ProbeField::createFieldStages(GpuContext& context) {
  generate_ = makeStage(context, "ddgi/generate.comp.glsl", {},
                        {{"RAYS", &batch_.buffers().rays},
                         {"DIRECTIONS", &directions_},
                         {"PROBES", &probe_positions_}},
                        sizeof(GeneratePush));
  std::vector<StageInput> field = {{"FIELD", &field_constants_},
                                   {"PROBE_INDEX", &probe_index_},
                                   {"IRRADIANCE", &irradiance_.copies[0]}};
  if (params_.visibility != 0) field.push_back({"MOMENTS", &moments_.copies[0]});
  field.push_back({"COUNTERS", &counter_buffer_});
  const auto bothCopies = [&](const Stage& stage) {
    Stage other = stage.with("IRRADIANCE", irradiance_.copies[1]);
    if (params_.visibility != 0) other = other.with("MOMENTS", moments_.copies[1]);
    return std::array<Stage, 2>{stage, other};
  };
  for (const bool store : {false, true}) {
    Defines defines = queryDefines(params_);
    const bool distances = !store && params_.visibility != 0;
    defines.emplace_back("PL_STORE_IRRADIANCE", store ? "1" : "0");
    defines.emplace_back("PL_STORE_DISTANCES", distances ? "1" : "0");
    std::vector<StageInput> inputs = field;
    inputs.push_back({"SURFACES", &batch_.buffers().surfaces});
    inputs.push_back({"RAYS", &batch_.buffers().rays});
    inputs.push_back({"RADIANCE", &batch_.buffers().radiance});
    if (distances) inputs.push_back({"DISTANCES", &batch_.buffers().distances});
    if (store) inputs.push_back({"HIT_IRRADIANCE", &batch_.buffers().hit_irradiance});
    (store ? resolve_with_irradiance_ : resolve_) = bothCopies(
        makeStage(context, "ddgi/resolve.comp.glsl", defines, inputs, sizeof(CountPush)));
  }
  std::vector<StageInput> inputs = field;
  // Points and results are bound anew by every query; these stand in until then.
  inputs.push_back({"POINTS", &directions_});
  inputs.push_back({"RESULTS", &counter_buffer_});
  query_ = bothCopies(
      makeStage(context, "ddgi/query.comp.glsl", queryDefines(params_), inputs, sizeof(CountPush)));
}

void ProbeField::update(uint64_t rotation, const BlendMode& irradiance, const BlendMode& moments) {
  const Timer timer;
  recorder_.resetTimes();
  const std::vector<Vec3f> directions = updateDirections(params_.rays, options_.seed, rotation);
  uploadArray(context_, directions_, directions);
  const auto weigh = [&](const Atlas& atlas, int side_texels, float exponent) {
    const auto side = static_cast<uint32_t>(side_texels - 2);
    const uint32_t items = side * side * static_cast<uint32_t>(params_.rays);
    recorder_.run("blend", atlas.make_weights, WeightsPush{items, side, exponent}, items);
  };
  weigh(irradiance_, params_.irradiance_texels, 1.0f);
  if (params_.visibility != 0)
    weigh(moments_, params_.moment_texels, static_cast<float>(params_.distance_exponent));
  for (uint32_t first = 0; first < probeCount(); first += probes_per_batch_)
    updateBatch(first, std::min(probes_per_batch_, probeCount() - first), irradiance, moments);
  recorder_.flush();
  current_ = 1 - current_;
  readCounters();
  if (counters_.non_finite_rays > 0)
    throw NumericalError(fmt::format(
        "resolve: {} probe rays carry a NaN or infinite radiance; check lights and emission",
        counters_.non_finite_rays));
  update_stages_ = recorder_.milliseconds();
  update_wall_ms_ = timer.milliseconds();
}

void ProbeField::updateBatch(uint32_t first_probe, uint32_t probe_count,
                             const BlendMode& irradiance, const BlendMode& moments) {
  const auto rays = static_cast<uint32_t>(params_.rays);
  const uint32_t items = probe_count * rays;
  recorder_.run("generate", generate_, GeneratePush{items, first_probe, rays}, items);
  batch_.trace(recorder_, items);
  recorder_.run("resolve", resolve_[static_cast<std::size_t>(current_)], CountPush{items}, items);
  blendAtlas(irradiance_, irradiance, first_probe, probe_count, true);
  if (params_.visibility != 0) blendAtlas(moments_, moments, first_probe, probe_count, false);
}

void ProbeField::blendAtlas(const Atlas& atlas, const BlendMode& mode, uint32_t first_probe,
                            uint32_t probe_count, bool is_irradiance) {
  const auto side = static_cast<uint32_t>(
      (is_irradiance ? params_.irradiance_texels : params_.moment_texels) - 2);
  const uint32_t groups = (probe_count + kProbesPerGroup - 1) / kProbesPerGroup;
  BlendPush push{};
  push.texels = side;
  push.blend.probe_count = probe_count;
  push.blend.first_probe = first_probe;
  push.blend.ray_count = static_cast<uint32_t>(params_.rays);
  push.blend.hysteresis = mode.hysteresis;
  push.blend.accumulate = 1.0f / static_cast<float>(mode.average_of);
  push.blend.encode_exponent = static_cast<float>(1.0 / params_.encoding_gamma);
  push.blend.backface_skip = params_.backface_skip != 0 ? 1u : 0u;
  push.blend.store_average = mode.store_average ? 1u : 0u;
  const std::size_t target = static_cast<std::size_t>(1 - current_);
  recorder_.runGroups("blend", atlas.blend[target], push, groups);
}

void ProbeField::readCounters() {
  counters_ = downloadArray<Counters>(context_, counter_buffer_).front();
}

void ProbeField::withQuery(std::span<const QueryPoint> points,
                           const std::function<void(const Stage&, const GpuBuffer&)>& body) {
  const GpuBuffer point_buffer =
      createBufferFrom(context_, points, MemoryUse::device, "query points");
  const GpuBuffer result_buffer =
      createBuffer(context_, points.size() * sizeof(Vec4f), MemoryUse::device, "query results");
  body(query_[static_cast<std::size_t>(current_)]
           .with("POINTS", point_buffer)
           .with("RESULTS", result_buffer),
       result_buffer);
}

std::vector<Vec4f> ProbeField::query(std::span<const QueryPoint> points) {
  std::vector<Vec4f> results(points.size());
  for (std::size_t first = 0; first < points.size(); first += kQueryChunk) {
    const auto part =
        points.subspan(first, std::min<std::size_t>(kQueryChunk, points.size() - first));
    const auto count = static_cast<uint32_t>(part.size());
    withQuery(part, [&](const Stage& stage, const GpuBuffer& answers) {
      recorder_.run("query", stage, CountPush{count}, count);
      recorder_.flush();
      download(context_, answers,
               std::as_writable_bytes(std::span<Vec4f>(results).subspan(first, part.size())));
    });
  }
  readCounters();
  for (std::size_t i = 0; i < results.size(); ++i)
    if (!isFinite(Vec3f(results[i].x, results[i].y, results[i].z)))
      throw NumericalError(fmt::format("query: the irradiance at point {} is not finite", i));
  return results;
}

std::vector<double> ProbeField::timeQuery(std::span<const QueryPoint> points, int repeats) {
  constexpr int kWarmUp = 2;
  PROBELAB_CHECK(points.size() <= kQueryChunk);
  const auto count = static_cast<uint32_t>(points.size());
  std::vector<double> times;
  withQuery(points, [&](const Stage& stage, const GpuBuffer&) {
    for (int i = -kWarmUp; i < repeats; ++i) {
      recorder_.resetTimes();
      recorder_.run("query", stage, CountPush{count}, count);
      recorder_.flush();
      if (i >= 0) times.push_back(recorder_.milliseconds().at("query"));
    }
  });
  return times;
}

ProbeField::RayResults ProbeField::shadeRays(std::span<const Ray> rays) {
  RayResults results{std::vector<Vec4f>(rays.size()), std::vector<Vec4f>(rays.size())};
  const RayBuffers& buffers = batch_.buffers();
  for (std::size_t first = 0; first < rays.size(); first += buffers.capacity) {
    const auto part =
        rays.subspan(first, std::min<std::size_t>(buffers.capacity, rays.size() - first));
    const auto count = static_cast<uint32_t>(part.size());
    batch_.uploadRays(part);
    batch_.trace(recorder_, count);
    recorder_.run("resolve", resolve_with_irradiance_[static_cast<std::size_t>(current_)],
                  CountPush{count}, count);
    recorder_.flush();
    const auto fetch = [&](const GpuBuffer& buffer, std::vector<Vec4f>& target) {
      download(context_, buffer,
               std::as_writable_bytes(std::span<Vec4f>(target).subspan(first, part.size())));
    };
    fetch(buffers.radiance, results.radiance);
    fetch(buffers.hit_irradiance, results.irradiance);
  }
  readCounters();
  return results;
}

// Texels of the current copy, each made of `words` words.
template <class T>
std::vector<T> ProbeField::downloadTexels(const Atlas& atlas, int side, uint32_t words,
                                          T (*unpack)(int, const uint32_t*), int format) {
  const std::size_t texels = std::size_t{probeCount()} * static_cast<std::size_t>(side * side);
  const auto stored = downloadArray<uint32_t>(
      context_, atlas.copies[static_cast<std::size_t>(current_)], texels * words);
  std::vector<T> unpacked(texels);
  for (std::size_t i = 0; i < texels; ++i) unpacked[i] = unpack(format, &stored[i * words]);
  return unpacked;
}

std::vector<Vec3f> ProbeField::irradianceTexels() {
  return downloadTexels<Vec3f>(irradiance_, params_.irradiance_texels,
                               irradianceWords(params_.irradiance_format), unpackIrradiance,
                               params_.irradiance_format);
}

std::vector<Vec2f> ProbeField::momentTexels() {
  if (params_.visibility == 0) return {};
  return downloadTexels<Vec2f>(moments_, params_.moment_texels, momentWords(params_.moment_format),
                               unpackMoments, params_.moment_format);
}

WorkCounts ProbeField::workOfUpdate() const {
  const auto square = [](int side) { return static_cast<uint64_t>((side - 2) * (side - 2)); };
  WorkCounts work;
  work.rays = uint64_t{probeCount()} * static_cast<uint64_t>(params_.rays);
  work.shadow_rays = work.rays * batch_.scene().light_count;
  work.texel_ray_products =
      work.rays * (square(params_.irradiance_texels) +
                   (params_.visibility != 0 ? square(params_.moment_texels) : 0));
  work.resolve_taps = work.rays * 8 * (params_.visibility != 0 ? 8 : 4);
  return work;
}

uint64_t ProbeField::atlasBytes() const { return probeCount() * atlasBytesPerProbe(params_); }

}  // namespace probelab
