// SPDX-License-Identifier: Apache-2.0
#include "ddgi/probe_field.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/timer.h"
#include "ddgi/directions.h"
#include "ddgi/field_constants.h"
#include "push_constants.h"

namespace probelab {
namespace {

struct QueryPush {
  uint32_t item_count, unused;
  FieldAddresses field;
  uint64_t points;
};
struct StatsPush {
  uint32_t probe_count, texels;
  uint64_t before, after;
  float gamma;
  uint32_t unused;
};
static_assert(sizeof(InfluenceEntry) == sizeof(VoxelEntry));
constexpr int kFlatChanges = 3;  // after so many a probe takes all rays for good
constexpr uint32_t kQueryChunk = 1u << 20;

// Rays that a batch holds, whole probes: the working set and the largest buffer bound them.
uint32_t raysPerBatch(const GpuContext& context, const Scene& scene, const Params& params,
                      const ProbeLayout& layout, const FieldSettings& options) {
  const auto rays = static_cast<uint64_t>(params.rays);
  const uint64_t by_set = options.working_set_bytes / rayBytes(!scene.lights.empty());
  const uint64_t by_range = context.info().max_storage_buffer_range / sizeof(RaySurface);
  const uint64_t probes = std::max<uint64_t>(std::min(by_set, by_range) / rays, 1);
  const uint64_t needed = std::min<uint64_t>(probes, layout.positions.size()) * rays;
  return static_cast<uint32_t>(std::max(needed, static_cast<uint64_t>(params.fixed_rays)));
}

float footprintOf(const Params& params) {
  return static_cast<float>(params.texture_footprint) * raySpread(params.rays);
}

uint32_t reducedRays(const Params& params) {
  return static_cast<uint32_t>(std::max(1.0, std::round(params.rays * params.flat_ray_share)));
}

// Query points that the shader can take as they are, since it indexes texels by what it computes
// from them: normals of unit length, and no point without a place or a direction.
class SanePoints {
 public:
  explicit SanePoints(std::span<const QueryPoint> asked) : points_(asked) {
    const auto is_fine = [](const QueryPoint& p) { return isUsable(p) && isUnit(p.normal); };
    if (std::all_of(asked.begin(), asked.end(), is_fine)) return;
    for (std::size_t i = 0; i < asked.size(); ++i) {
      if (!isUsable(asked[i])) {
        refused_.push_back(i);
        continue;
      }
      changed_.push_back(asked[i]);
      Vec3f& normal = changed_.back().normal;
      if (!isUnit(normal)) normal = Vec3f(normalize(Vec3d(normal)));
    }
    points_ = changed_;
  }
  std::span<const QueryPoint> points() const { return points_; }
  const std::vector<std::size_t>& refused() const { return refused_; }

  // Answers of points() -> of those asked, (0, 0, 0, -1) where one was refused.
  std::vector<Vec4f> spread(std::vector<Vec4f> answers) const {
    if (refused_.empty()) return answers;
    std::vector<Vec4f> all(answers.size() + refused_.size(), Vec4f(0, 0, 0, -1));
    std::size_t next = 0, taken = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (next < refused_.size() && refused_[next] == i)
        ++next;
      else
        all[i] = answers[taken++];
    }
    return all;
  }

 private:
  static bool isUnit(const Vec3f& n) { return std::abs(dot(Vec3d(n), Vec3d(n)) - 1) < 1e-4; }
  static bool isUsable(const QueryPoint& p) {
    return isFinite(p.position) && isFinite(p.normal) && isFinite(p.view) &&
           dot(Vec3d(p.normal), Vec3d(p.normal)) > 0;
  }
  std::span<const QueryPoint> points_;
  std::vector<QueryPoint> changed_;  // empty where all are fine
  std::vector<std::size_t> refused_;
};

}  // namespace

ProbeField::ProbeField(GpuContext& context, const Scene& scene, const EmbreeScene& embree,
                       const ProbeLayout& layout, const Params& params,
                       const FieldSettings& options)
    : context_(context),
      layout_((validateParams(params), validateLayout(layout, params), layout)),
      params_(params),
      options_(options),
      rays_per_batch_(raysPerBatch(context, scene, params, layout, options)),
      batch_(context, scene, embree, options.tracer, rays_per_batch_, footprintOf(params)),
      recorder_(context),
      counter_buffer_(createBuffer(context, sizeof(CounterData), MemoryUse::device, "counters")) {
  createStates(context);
  irradiance_ =
      makeAtlas(context, AtlasKind::irradiance, params_, probeCount(), options.accumulate);
  if (params.visibility != 0)
    moments_ = makeAtlas(context, AtlasKind::moments, params_, probeCount(), options.accumulate);
  full_ = createRaySet(context, params.rays);
  if (params.flat_ray_share < 1) {
    reduced_ = createRaySet(context, static_cast<int>(reducedRays(params)));
    flat_states_.resize(probeCount());
  }
  createFieldStages(context);
}

void ProbeField::createStates(GpuContext& context) {
  states_ = settleStates(context, batch_, recorder_, layout_, params_);
  state_stages_ = recorder_.milliseconds();
  full_count_ = states_.activeCount();
  if (full_count_ == 0)
    throwInput(
        "{}: classification leaves none of {} probes active; lower backface_threshold's "
        "strictness or set classification = \"none\"",
        params_.name, probeCount());
  moved_ = isMoved(layout_, states_);
  field_constants_ = uploadFieldConstants(context, layout_, params_);
  const auto deviceArray = [&](const auto& values, const char* name) {
    return createBufferFrom(context, values, MemoryUse::device, name);
  };
  createIndex(context);
  probe_positions_ = deviceArray(states_.positions, "probe positions");
  if (usesProbeList()) {
    std::vector<uint32_t> list;
    for (uint32_t p = 0; p < probeCount(); ++p)
      if (states_.active[p] != 0) list.push_back(p);
    list.resize(probeCount());
    probe_list_ = deviceArray(list, "probe list");
  }
}

// From places to active probes.
void ProbeField::createIndex(GpuContext& context) {
  const auto deviceArray = [&](const auto& values, const char* name) {
    return createBufferFrom(context, values, MemoryUse::device, name);
  };
  if (queryInterpolant(layout_) == PL_INTERPOLANT_LATTICE) {
    probe_index_ = deviceArray(activeIndex(layout_, states_), "probe index");
    if (params_.fallback == PL_FALLBACK_NEAREST)
      nearest_probe_ = deviceArray(nearestIndex(layout_, states_), "nearest probes");
    return;
  }
  InfluenceGrid influence =
      activeInfluence(layout_.influence, states_.positions, states_.active);
  probes_per_query_ =
      static_cast<double>(influence.entries.size()) / static_cast<double>(influence.nearest.size());
  if (influence.entries.empty()) influence.entries.emplace_back();  // a buffer holds something
  voxel_begin_ = deviceArray(influence.voxel_begin, "voxel begins");
  entries_ = deviceArray(influence.entries, "voxel entries");
  walls_ = !influence.pieces.planes.empty();
  if (walls_) {
    plane_of_voxel_ = deviceArray(influence.pieces.plane_of_voxel, "planes of voxels");
    planes_ = deviceArray(influence.pieces.planes, "planes");
  }
  if (params_.fallback == PL_FALLBACK_NEAREST)
    nearest_probe_ = deviceArray(influence.nearest, "nearest probes");
  std::vector<Vec4f> places;
  std::vector<float> clamps;
  const float clamp = static_cast<float>(params_.distance_clamp) / layout_.support_radius_m;
  for (std::size_t p = 0; p < layout_.lengths.size(); ++p) {
    const Vec3f& at = states_.positions[p];
    places.emplace_back(at.x, at.y, at.z, layout_.lengths[p].bias);
    clamps.push_back(clamp * layout_.lengths[p].support);
  }
  places_ = deviceArray(places, "probe places");
  if (params_.visibility != 0) probe_clamps_ = deviceArray(clamps, "probe clamps");
}

bool ProbeField::usesProbeList() const {
  return params_.flat_ray_share < 1 || full_count_ + reduced_count_ < probeCount();
}

std::unique_ptr<ProbeField::RaySet> ProbeField::createRaySet(GpuContext& context, int rays) {
  auto set = std::make_unique<RaySet>();
  set->rays = rays;
  set->directions = createBuffer(context, sizeof(Vec3f) * static_cast<uint64_t>(rays),
                                 MemoryUse::device, "directions");
  std::vector<StageInput> inputs = {{"DIRECTIONS", &set->directions},
                                    {"PROBES", &probe_positions_}};
  if (probe_list_) inputs.push_back({"PROBE_LIST", &probe_list_});
  set->generate =
      makeStage(context, "ddgi/generate.comp.glsl", {{"PL_PROBE_LIST", probe_list_ ? "1" : "0"}},
                inputs, sizeof(GeneratePush));
  const auto blend = [&](const ProbeAtlas& atlas) {
    return std::make_unique<BlendStage>(context, params_, atlas, batch_.buffers(), probe_list_,
                                        probe_clamps_, counter_buffer_);
  };
  set->irradiance = blend(irradiance_);
  if (params_.visibility != 0) set->moments = blend(moments_);
  return set;
}

bool ProbeField::pointsAreProbes() const {
  if (states_.activeCount() != layout_.probe_of_point.size()) return false;
  for (std::size_t i = 0; i < layout_.probe_of_point.size(); ++i)
    if (layout_.probe_of_point[i] != static_cast<int>(i)) return false;
  return true;
}

FieldAccess ProbeField::access() const {
  FieldAccess access;
  access.layout = {.moved = moved_,
                   .full = pointsAreProbes(),
                   .walls = walls_,
                   .interpolant = queryInterpolant(layout_)};
  access.inputs = {{"FIELD", &field_constants_, true}, {"COUNTERS", &counter_buffer_}};
  const auto copy = static_cast<std::size_t>(current_);
  access.addresses = {.irradiance = irradiance_.copies[copy].address(),
                      .moments = params_.visibility != 0 ? moments_.copies[copy].address() : 0,
                      .probe_index = probe_index_ ? probe_index_.address() : 0,
                      .nearest_probe = nearest_probe_ ? nearest_probe_.address() : 0,
                      .positions = probe_positions_.address(),
                      .voxel_begin = voxel_begin_ ? voxel_begin_.address() : 0,
                      .entries = entries_ ? entries_.address() : 0,
                      .places = places_ ? places_.address() : 0,
                      .plane_of_voxel = walls_ ? plane_of_voxel_.address() : 0,
                      .planes = walls_ ? planes_.address() : 0};
  return access;
}

void ProbeField::createFieldStages(GpuContext& context) {
  const FieldAccess field = access();
  resolve_ = makeStage(context, "ddgi/resolve.comp.glsl",
                       resolveDefines(params_, field.layout, RayUse::probes), field.inputs,
                       sizeof(ResolvePush));
  std::vector<StageInput> inputs = field.inputs;
  inputs.push_back({"RESULTS", &counter_buffer_});  // bound anew by every query
  query_ = makeStage(context, "ddgi/query.comp.glsl", fieldDefines(params_, field.layout), inputs,
                     sizeof(QueryPush));
  if (params_.variability_threshold <= 0 && !reduced_) return;
  stats_buffer_ = createBuffer(context, probeCount() * sizeof(Vec4f), MemoryUse::device, "stats");
  stats_ = makeStage(context, "ddgi/probe_stats.comp.glsl", atlasDefines(params_),
                     {{"STATS", &stats_buffer_}}, sizeof(StatsPush));
}

void ProbeField::setDirections(RaySet& set, uint64_t rotation) {
  const std::vector<Vec3f> directions = updateDirections(set.rays, options_.seed, rotation);
  uploadArray(context_, set.directions, directions);
  recorder_.onHost("blend", [&] {
    set.irradiance->setDirections(directions);
    if (set.moments) set.moments->setDirections(directions);
  });
}

void ProbeField::update(uint64_t rotation, const BlendMode& irradiance, const BlendMode& moments) {
  const Timer timer;
  recorder_.resetTimes();
  setDirections(*full_, rotation);
  updateProbes(*full_, 0, full_count_, irradiance, moments);
  if (reduced_count_ > 0) {
    setDirections(*reduced_, rotation);
    updateProbes(*reduced_, full_count_, reduced_count_, irradiance, moments);
  }
  recorder_.flush();
  const uint32_t known = counters_.non_finite_rays;
  readCounters();
  // Before the copies change places, so that the field stays as it was and nothing is fed back.
  if (counters_.non_finite_rays > known)
    throw NumericalError(fmt::format(
        "resolve: {} probe rays carry a NaN or infinite radiance; check lights and emission",
        counters_.non_finite_rays - known));
  current_ = 1 - current_;
  ++updates_;
  if (stats_.pipeline) measureProbes();
  update_stages_ = recorder_.milliseconds();
  update_wall_ms_ = timer.milliseconds();
}

void ProbeField::updateProbes(const RaySet& set, uint32_t first, uint32_t count,
                              const BlendMode& irradiance, const BlendMode& moments) {
  const auto rays = static_cast<uint32_t>(set.rays);
  const FieldAddresses field = access().addresses;
  for (uint32_t done = 0; done < count; done += rays_per_batch_ / rays) {
    const uint32_t probes = std::min(rays_per_batch_ / rays, count - done);
    const uint32_t n = probes * rays;
    const bool by_direction = params_.ray_order == PL_RAYS_BY_DIRECTION;
    const RayItems items{probes, first + done, by_direction ? 1 : rays, by_direction ? probes : 1};
    recorder_.run("generate", set.generate,
                  GeneratePush{n, items, 0, batch_.buffers().rays.address()}, n);
    batch_.trace(recorder_, n, TextureDetail::footprint);
    recorder_.run("resolve", resolve_,
                  makeResolvePush(n, params_.radiance_clamp, field, batch_.buffers()), n);
    set.irradiance->record(recorder_, items, irradiance, 1 - current_, updates_);
    if (set.moments) set.moments->record(recorder_, items, moments, 1 - current_, updates_);
  }
}

// Variability, and which probes are bright and flat enough for fewer rays in the next update.
void ProbeField::measureProbes() {
  const auto copy = static_cast<std::size_t>(current_);
  recorder_.run(
      "variability", stats_,
      StatsPush{probeCount(), static_cast<uint32_t>(irradiance_.texels),
                irradiance_.copies[1 - copy].address(), irradiance_.copies[copy].address(),
                static_cast<float>(params_.encoding_gamma), 0},
      probeCount());
  recorder_.flush();
  const auto stats = downloadArray<Vec4f>(context_, stats_buffer_);
  double mean = 0, variability = 0, lit_texels = 0;
  for (uint32_t p = 0; p < probeCount(); ++p) {
    if (states_.active[p] == 0) continue;
    mean += static_cast<double>(stats[p].x);
    variability += static_cast<double>(stats[p].z);
    lit_texels += static_cast<double>(stats[p].w);
  }
  mean /= states_.activeCount();
  variability_ = lit_texels > 0 ? variability / lit_texels : 1;
  if (reduced_) chooseFlatProbes(stats, mean);
}

// A probe that changes sides again and again takes all rays, or no bounce series would settle.
void ProbeField::chooseFlatProbes(std::span<const Vec4f> stats, double mean) {
  std::vector<uint32_t> list, flat;
  for (uint32_t p = 0; p < probeCount(); ++p) {
    if (states_.active[p] == 0) continue;
    FlatState& state = flat_states_[p];
    const bool qualifies = static_cast<double>(stats[p].x) > params_.flat_brightness * mean &&
                           static_cast<double>(stats[p].y) < params_.flat_contrast;
    const bool is_flat = qualifies && state.changes < kFlatChanges;
    if (is_flat != state.is_flat) ++state.changes;
    state.is_flat = is_flat;
    (is_flat ? flat : list).push_back(p);
  }
  full_count_ = static_cast<uint32_t>(list.size());
  reduced_count_ = static_cast<uint32_t>(flat.size());
  list.insert(list.end(), flat.begin(), flat.end());
  uploadArray(context_, probe_list_, list);
}

void ProbeField::readCounters() {
  const auto data = downloadArray<CounterData>(context_, counter_buffer_).front();
  counters_ = {.non_finite_rays = data.non_finite_rays,
               .clamped_texels = data.clamped_texels + clamped_uploads_,
               .tiny_weight_sums = data.tiny_weight_sums,
               .unoccluded_answers = data.answers[PL_ANSWER_UNOCCLUDED],
               .nearest_answers = data.answers[PL_ANSWER_NEAREST],
               .empty_answers = data.answers[PL_ANSWER_NONE] + refused_queries_};
  counters_.fallback_queries =
      counters_.unoccluded_answers + counters_.nearest_answers + counters_.empty_answers;
}

std::vector<Vec4f> ProbeField::query(std::span<const QueryPoint> asked) {
  const SanePoints sane(asked);
  const std::span<const QueryPoint> points = sane.points();
  std::vector<Vec4f> results(points.size());
  for (std::size_t first = 0; first < points.size(); first += kQueryChunk) {
    const auto part =
        points.subspan(first, std::min<std::size_t>(kQueryChunk, points.size() - first));
    const auto count = static_cast<uint32_t>(part.size());
    const GpuBuffer input = createBufferFrom(context_, part, MemoryUse::device, "query points");
    const GpuBuffer output =
        createBuffer(context_, count * sizeof(Vec4f), MemoryUse::device, "query results");
    recorder_.run("query", query_.with("RESULTS", output),
                  QueryPush{count, 0, access().addresses, input.address()}, count);
    recorder_.flush();
    download(context_, output,
             std::as_writable_bytes(std::span<Vec4f>(results).subspan(first, part.size())));
  }
  refused_queries_ += static_cast<uint32_t>(sane.refused().size());
  readCounters();
  for (std::size_t i = 0; i < results.size(); ++i)
    if (!isFinite(Vec3f(results[i].x, results[i].y, results[i].z)))
      throw NumericalError(fmt::format("query: the irradiance at point {} is not finite", i));
  return sane.spread(std::move(results));
}

std::vector<double> ProbeField::timeQuery(std::span<const QueryPoint> points, int repeats) {
  constexpr int kWarmUp = 2;
  PROBELAB_CHECK(points.size() <= kQueryChunk);
  const auto count = static_cast<uint32_t>(points.size());
  const GpuBuffer input = createBufferFrom(context_, points, MemoryUse::device, "query points");
  const GpuBuffer output =
      createBuffer(context_, count * sizeof(Vec4f), MemoryUse::device, "query results");
  const Stage stage = query_.with("RESULTS", output);
  std::vector<double> times;
  for (int i = -kWarmUp; i < repeats; ++i) {
    recorder_.resetTimes();
    recorder_.run("query", stage, QueryPush{count, 0, access().addresses, input.address()}, count);
    recorder_.flush();
    if (i >= 0) times.push_back(recorder_.milliseconds().at("query"));
  }
  return times;
}

std::vector<Vec3f> ProbeField::irradianceTexels() {
  return downloadIrradiance(context_, irradiance_, current_);
}

std::vector<Vec2f> ProbeField::momentTexels() {
  if (params_.visibility == 0) return {};
  return downloadMoments(context_, moments_, current_);
}

void ProbeField::setIrradianceTexels(std::span<const Vec3f> texels) {
  const uint64_t per_probe = uint64_t{irradiance_.side()} * irradiance_.side();
  for (std::size_t i = 0; i < texels.size(); ++i)
    if (!isFinite(texels[i]) || minComponent(texels[i]) < 0)
      throw NumericalError(fmt::format(
          "set texels: an irradiance texel of probe {} is negative or not finite", i / per_probe));
  clamped_uploads_ += uploadIrradiance(context_, irradiance_, current_, texels);
  readCounters();
}

WorkCounts ProbeField::workOfUpdate() const {
  WorkCounts work;
  const auto add = [&](const RaySet* set, uint64_t probes) {
    if (set == nullptr) return;
    work.rays += probes * static_cast<uint64_t>(set->rays);
    work.texel_ray_products += probes * (set->irradiance->productsPerProbe() +
                                         (set->moments ? set->moments->productsPerProbe() : 0));
  };
  add(full_.get(), full_count_);
  add(reduced_.get(), reduced_count_);
  work.shadow_rays = work.rays * batch_.scene().light_count;
  if (params_.feedback != 0)
    work.resolve_taps = static_cast<uint64_t>(std::llround(
        static_cast<double>(work.rays * (params_.visibility != 0 ? 8 : 4)) * probes_per_query_));
  return work;
}

uint64_t ProbeField::atlasBytes() const { return probeCount() * atlasBytesPerProbe(params_); }

uint64_t ProbeField::stateBytes() const {
  const auto bytes = [](const GpuBuffer& buffer) { return buffer ? buffer.size() : 0; };
  return (pointsAreProbes() ? 0 : bytes(probe_index_)) + (moved_ ? bytes(probe_positions_) : 0) +
         bytes(nearest_probe_) + bytes(probe_list_) + bytes(voxel_begin_) + bytes(entries_) +
         bytes(plane_of_voxel_) + bytes(planes_) +
         bytes(places_) + bytes(probe_clamps_);
}

}  // namespace probelab
