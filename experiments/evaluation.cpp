// SPDX-License-Identifier: GPL-3.0-or-later
#include "evaluation.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/timer.h"
#include "metrics/bootstrap.h"

namespace probelab {
namespace {

constexpr std::size_t kTimedPoints = 65536;  // enough that the dispatch itself does not count
constexpr int kTimedQueries = 9;
constexpr const char* kSpeedStages[] = {"generate", "trace",   "shade",
                                        "occlude",  "resolve", "blend"};
constexpr std::size_t kFlickerWindow = 32;

std::vector<QueryPoint> queryPoints(const Receivers& receivers) {
  std::vector<QueryPoint> points;
  points.reserve(receivers.points.size());
  for (const Receiver& r : receivers.points) points.push_back({r.position, r.normal, r.view});
  return points;
}

Json metricsJson(const ErrorMetrics& metrics) {
  Json json;
  for (const auto& [name, value] : namedMetrics(metrics))
    json[std::string(name)] = optionalNumber(value);
  Json nrmse_rgb = Json::array(), bias_rgb = Json::array();
  for (const auto& value : metrics.nrmse_rgb) nrmse_rgb.push_back(optionalNumber(value));
  for (const auto& value : metrics.bias_rgb) bias_rgb.push_back(optionalNumber(value));
  json["nrmse_rgb"] = nrmse_rgb;
  json["bias_rgb"] = bias_rgb;
  return json;
}

Json kindJson(const std::optional<ErrorMetrics>& metrics,
              const std::optional<ErrorMetrics>& noise_floor) {
  if (!metrics) return nullptr;
  Json json = metricsJson(*metrics);
  json["noise_floor"] = noise_floor ? metricsJson(*noise_floor) : Json(nullptr);
  return json;
}

double scoredMean(const std::vector<Vec3f>& estimates, const Receivers& receivers,
                  ScoredSplit split) {
  double sum = 0, area = 0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    if (!isScored(receivers.points[i], split)) continue;
    sum += receivers.points[i].area * luminance(Vec3d(estimates[i]));
    area += receivers.points[i].area;
  }
  return area > 0 ? sum / area : 0;
}

// Number of the first update that reaches `share` of the last one's mean; null when that is in the
// last quarter of the run: then the last one is no level that light has settled at.
Json updatesTo(const std::vector<double>& means, double share) {
  for (std::size_t i = 0; 4 * (i + 1) <= 3 * means.size(); ++i)
    if (means[i] >= share * means.back()) return i + 1;
  return nullptr;
}

// 1, 2, 3, 4, 6, 8, 12, 16, 24, ...
bool isCheckpoint(int update) {
  const int odd = update >> std::countr_zero(static_cast<unsigned>(update));
  return odd == 1 || odd == 3;
}

}  // namespace

ScoredSplit parseScoredSplit(const std::string& name) {
  if (name == "heldout") return ScoredSplit::heldout;
  if (name == "train") return ScoredSplit::train;
  if (name == "all") return ScoredSplit::all;
  throwInput("--split {}: it is heldout, train or all", name);
}

bool isScored(const Receiver& receiver, ScoredSplit split) {
  if (split == ScoredSplit::all) return true;
  return (receiver.split == Split::heldout) == (split == ScoredSplit::heldout);
}

std::vector<Vec3f> queryReceivers(ProbeField& field, const Receivers& receivers) {
  const std::vector<Vec4f> answers = field.query(queryPoints(receivers));
  std::vector<Vec3f> estimates(answers.size());
  for (std::size_t i = 0; i < answers.size(); ++i) {
    estimates[i] = {answers[i].x, answers[i].y, answers[i].z};
  }
  return estimates;
}

ReceiverColumns receiverColumns(const Receivers& receivers, ScoredSplit split) {
  ReceiverColumns scored;
  bool has_kinds = true;
  for (std::size_t i = 0; i < receivers.points.size(); ++i) {
    const Receiver& r = receivers.points[i];
    if (!isScored(r, split)) continue;
    scored.index.push_back(i);
    scored.a.push_back(r.a), scored.b.push_back(r.b), scored.position.push_back(r.position);
    scored.area.push_back(static_cast<float>(r.area));
    scored.region.push_back(r.region);
    scored.kind.push_back(r.kind == ReceiverKind::surface ? kSurfaceReceiver : kVolumeReceiver);
    has_kinds = has_kinds && r.kind != ReceiverKind::point;
  }
  if (!has_kinds) scored.kind.clear();
  return scored;
}

std::vector<Vec3f> ReceiverColumns::pick(const std::vector<Vec3f>& estimates) const {
  std::vector<Vec3f> picked;
  for (const std::size_t i : index) picked.push_back(estimates[i]);
  return picked;
}

ReceiverSamples ReceiverColumns::samples(const std::vector<Vec3f>& estimate) const {
  return {.estimate = estimate,
          .a = a,
          .b = b,
          .position = position,
          .area = area,
          .region = region,
          .kind = kind};
}

ErrorReport scoreEstimates(const std::vector<Vec3f>& estimates, const Receivers& receivers,
                           ScoredSplit split) {
  const ReceiverColumns scored = receiverColumns(receivers, split);
  if (scored.index.empty())
    throwInput(
        "no receiver is in the part of --split; take more of them with --count, or --split "
        "all");
  const std::vector<Vec3f> estimate = scored.pick(estimates);
  return computeErrors(scored.samples(estimate));
}

std::vector<double> blockErrors(const std::vector<Vec3f>& estimates, const Receivers& receivers,
                                const Box3f& bounds) {
  const ReceiverColumns all = receiverColumns(receivers, ScoredSplit::all);
  return blockSquaredErrors(all.samples(estimates), spatialBlocks(all.position, bounds));
}

Json toJson(const ErrorReport& report) {
  Json json = metricsJson(report.all);
  json["noise_floor"] = metricsJson(report.noise_floor);
  json["surface"] = kindJson(report.surface, report.surface_noise_floor);
  json["volume"] = kindJson(report.volume, report.volume_noise_floor);
  json["mean_reference"] = report.mean_reference;
  json["resolved"] = Json::object();
  const auto values = namedMetrics(report.all), floors = namedMetrics(report.noise_floor);
  for (std::size_t i = 0; i < values.size(); ++i)
    json["resolved"][std::string(values[i].first)] = isResolved(values[i].second, floors[i].second);
  return json;
}

Json memoryJson(const ProbeField& field) {
  return {{"atlas", field.atlasBytes()},
          {"state_and_index", field.stateBytes()},
          {"atlas_per_probe", atlasBytesPerProbe(field.params())}};
}

Json workJson(const WorkCounts& work) {
  return {{"rays", work.rays},
          {"shadow_rays", work.shadow_rays},
          {"texel_ray_products", work.texel_ray_products},
          {"resolve_taps", work.resolve_taps}};
}

Json stabilityJson(const Counters& before, const Counters& after) {
  return {{"non_finite", after.non_finite_rays},
          {"clamped", after.clamped_texels},
          {"fallback_queries", after.fallback_queries - before.fallback_queries},
          {"tiny_weight_sum", after.tiny_weight_sums - before.tiny_weight_sums},
          {"unoccluded_answers", after.unoccluded_answers - before.unoccluded_answers},
          {"nearest_answers", after.nearest_answers - before.nearest_answers},
          {"empty_answers", after.empty_answers - before.empty_answers},
          {"bounce_fallback_queries", before.fallback_queries}};
}

double meanReference(const Receivers& receivers, ScoredSplit split) {
  std::vector<Vec3f> truth;
  for (const Receiver& r : receivers.points) truth.push_back((r.a + r.b) * 0.5f);
  return scoredMean(truth, receivers, split);
}

std::vector<QueryPoint> timedPoints(const Receivers& receivers) {
  const std::vector<QueryPoint> once = queryPoints(receivers);
  std::vector<QueryPoint> points;
  while (points.size() < kTimedPoints && !once.empty())
    points.insert(points.end(), once.begin(), once.end());
  points.resize(std::min(points.size(), kTimedPoints));
  return points;
}

Json measureSpeed(ProbeField& field, const FieldRun& run, const Receivers& receivers) {
  Json speed, spread;
  const auto add = [&](const std::string& name, const TimeSummary& times, double factor) {
    speed[name] = times.median * factor;
    spread[name] = {times.p5 * factor, times.p95 * factor};
    return times.median * factor;
  };
  const double update_ms = add("update_ms", summarizeTimes(afterWarmUp(run.update_ms)), 1);
  double trace_ms = 0;
  for (const char* stage : kSpeedStages) {
    const auto found = run.stage_ms.find(stage);
    const TimeSummary times =
        found == run.stage_ms.end() ? TimeSummary{} : summarizeTimes(afterWarmUp(found->second));
    const double median = add(std::string(stage) + "_ms", times, 1);
    if (std::string(stage) == "trace") trace_ms = median;
  }
  const std::vector<QueryPoint> points = timedPoints(receivers);
  const double per_point = 1e6 / static_cast<double>(points.size());
  const double query_ns =
      add("query_ns_per_point", summarizeTimes(field.timeQuery(points, kTimedQueries)), per_point);
  speed["frame_ms"] = update_ms + query_ns * 2073600 * 1e-6;
  speed["rays_per_s"] = optionalNumber(
      trace_ms > 0
          ? std::optional<double>(static_cast<double>(field.workOfUpdate().rays) / trace_ms * 1e3)
          : std::nullopt);
  speed["state_ms"] = Json::object();
  for (const char* stage : {"relocate", "classify"})
    if (field.stateStages().contains(stage))
      speed["state_ms"][stage] = field.stateStages().at(stage);
  speed["spread"] = spread;
  return speed;
}

Json scoreOutline() {
  ErrorReport report;
  report.surface = report.volume = ErrorMetrics{};
  report.surface_noise_floor = report.volume_noise_floor = ErrorMetrics{};
  Json speed = {{"update_ms", nullptr}};
  for (const char* stage : kSpeedStages) speed[std::string(stage) + "_ms"] = nullptr;
  speed["query_ns_per_point"] = speed["frame_ms"] = speed["rays_per_s"] = nullptr;
  speed["state_ms"] = Json::object();
  speed["spread"] = Json::object();
  return {{"error", toJson(report)}, {"stability", stabilityJson({}, {})}, {"speed", speed}};
}

std::string formatEstimates(const std::vector<Vec3f>& estimates, const Receivers& receivers,
                            const Scene& scene) {
  std::string csv =
      "index,x,y,z,nx,ny,nz,kind,region,split,area,"
      "est_r,est_g,est_b,a_r,a_g,a_b,b_r,b_g,b_b\n";
  for (std::size_t i = 0; i < receivers.points.size(); ++i) {
    const Receiver& r = receivers.points[i];
    const Vec3d p = toWorld(scene, r.position);
    const Vec3f& e = estimates[i];
    csv += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", i, p.x, p.y,
                       p.z, r.normal.x, r.normal.y, r.normal.z, receiverKindName(r.kind), r.region,
                       r.split == Split::heldout ? "heldout" : "train", r.area, e.x, e.y, e.z,
                       r.a.x, r.a.y, r.a.z, r.b.x, r.b.y, r.b.z);
  }
  return csv;
}

void TemporalRecord::add(int done) {
  std::vector<Vec3f> estimates = queryReceivers(field_, receivers_);
  means_.push_back(scoredMean(estimates, receivers_, split_));
  if (isCheckpoint(done))
    nrmse_after_.emplace_back(done, scoreEstimates(estimates, receivers_, split_).all.nrmse);
  window_.push_back(std::move(estimates));
  if (window_.size() > kFlickerWindow) window_.pop_front();
}

Json TemporalRecord::toJson() const {
  Json json = {{"nrmse_after", Json::object()},
               {"updates_to_90", updatesTo(means_, 0.9)},
               {"updates_to_95", updatesTo(means_, 0.95)},
               {"updates_to_99", updatesTo(means_, 0.99)},
               {"flicker", nullptr}};
  for (const auto& [updates, nrmse] : nrmse_after_)
    json["nrmse_after"][std::to_string(updates)] = optionalNumber(nrmse);
  if (window_.size() < kFlickerWindow) return json;
  double flicker = 0, weight = 0;
  for (std::size_t i = 0; i < receivers_.points.size(); ++i) {
    double mean = 0, mean_square = 0;
    for (const std::vector<Vec3f>& estimates : window_) {
      const double l = luminance(Vec3d(estimates[i]));
      mean += l / kFlickerWindow, mean_square += l * l / kFlickerWindow;
    }
    if (!(mean > 0) || !isScored(receivers_.points[i], split_)) continue;
    const double variance = std::max(0.0, mean_square - mean * mean);
    flicker += receivers_.points[i].area * std::sqrt(variance) / mean;
    weight += receivers_.points[i].area;
  }
  if (weight > 0) json["flicker"] = flicker / weight;
  return json;
}

}  // namespace probelab
