// SPDX-License-Identifier: GPL-3.0-or-later
#include "stability_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "base/suggest.h"
#include "base/timer.h"
#include "device.h"
#include "metrics/bootstrap.h"
#include "evaluation.h"
#include "layout_source.h"
#include "stability/suite.h"

namespace probelab {
namespace {

constexpr int kSeeds = 5;
constexpr double kMoved = 1e-3;  // in nrmse, beside the noise: receivers and rays on edges
constexpr int kSwitched = 32;    // updates before, in and after the dark
constexpr float kSwitchHysteresis = 0.5f;

// A variation of the run.
struct Run {
  SceneMap map;
  Params params;
  TracerKind tracer = TracerKind::embree;
  uint64_t seed = 0;
  int threads = 0;
};

struct RowPlan {
  std::string id, title, tracer, format, expectation;
  std::function<Measurement()> measure;
};

class SceneSuite {
 public:
  SceneSuite(const SceneStabilityOptions& options, const Invocation& invocation)
      : options_(options),
        invocation_(invocation),
        setup_(options.scene, invocation),
        params_(resolveParams(options.field)),
        truth_(
            obtainTruth(options.truth, setup_.scene, setup_.embree, setup_.reachability, invocation)
                .receivers) {}

  // What was finished before a signal, then with "interrupted": true.
  Json run(const std::string& name);

 private:
  struct Answer {
    std::vector<Vec3f> estimates;
    double nrmse = 0;
  };
  Run base() const {
    return {{}, params_, mainTracer(), invocation_.common.seed, invocation_.common.threads};
  }
  TracerKind mainTracer() const {
    return options_.tracer == "rayquery" ? TracerKind::rayquery : TracerKind::embree;
  }
  double nrmseOf(const std::vector<Vec3f>& estimates) const;
  std::optional<double> samplingOf(const std::vector<Vec3f>& estimates) const;
  double distance(const Answer& answer, const Answer& from) const;
  double change(const Answer& answer, const Answer& from) const;
  const char* compared() const { return resolved_ ? "nrmse" : "E, rms,"; }
  std::vector<QueryPoint> queryPoints(const SceneMap& map) const;
  ProbeLayout layoutOf(const Scene& scene, const EmbreeScene& embree, const Params& params) const;
  std::unique_ptr<ProbeField> field(const Scene& scene, const EmbreeScene& embree, const Run& run);
  Answer answer(const Run& run);
  void measureBase();
  std::vector<RowPlan> plan();
  Measurement judged(double change, double bound, const std::string& text, double more);
  Measurement moved(const Run& run, double more);
  Measurement sameBits(const Run& run);
  double largestAlbedo() const;
  double formatShare(const Params& params) const;
  Measurement firstUpdate();
  Measurement lightOffAndOn();
  void measureRows(const std::vector<RowPlan>& rows, const std::function<void(Json)>& on_row);
  std::string trustedText(int digits, bool all) const;
  Json describe(const Json& rows, bool all) const;

  const SceneStabilityOptions& options_;
  const Invocation& invocation_;
  SceneSetup setup_;
  Params params_;
  Receivers truth_;
  Answer base_answer_;
  std::optional<double> floor_;      // of nrmse, by the truth's own noise
  std::optional<double> sampling_;   // half of the 95 % interval of nrmse over blocks of space
  bool resolved_ = false;            // nrmse is above its floor; else the fields are compared
  double deviation_ = 0;             // over seeds, of what rows compare
  double spread_ = 0;                // largest change by what must not matter
  std::vector<double> changes_;
};

double SceneSuite::nrmseOf(const std::vector<Vec3f>& estimates) const {
  const std::optional<double> nrmse = scoreEstimates(estimates, truth_, ScoredSplit::all).all.nrmse;
  if (!nrmse) throwInput(
        "{}: no receiver gets light, so nrmse is undefined; add a light (`probelab init` writes a "
        "scene TOML) or choose a lit --state",
        setup_.scene.path);
  return *nrmse;
}

std::vector<QueryPoint> SceneSuite::queryPoints(const SceneMap& map) const {
  std::vector<QueryPoint> points;
  for (const Receiver& r : truth_.points)
    points.push_back({map.point(r.position), map.direction(r.normal), map.direction(r.view)});
  return points;
}

ProbeLayout SceneSuite::layoutOf(const Scene& scene, const EmbreeScene& embree,
                                 const Params& params) const {
  const Reachability reachability = findReachable(scene, embree);
  return obtainLayout({scene, embree, reachability}, options_.field, params,
                      invocation_.common.seed, "");
}

std::unique_ptr<ProbeField> SceneSuite::field(const Scene& scene, const EmbreeScene& embree,
                                              const Run& run) {
  FieldSettings settings;
  settings.seed = run.seed;
  settings.tracer = run.tracer;
  return std::make_unique<ProbeField>(setup_.gpu, scene, embree,
                                      layoutOf(scene, embree, run.params), run.params, settings);
}

SceneSuite::Answer SceneSuite::answer(const Run& run) {
  const ThreadLimit limit(run.threads);
  const Scene scene = mappedScene(setup_.scene, run.map);
  const EmbreeScene embree(scene);
  const auto probes = field(scene, embree, run);
  convergeField(*probes, {.average = options_.field.updates.value_or(kDefaultAveraged)});
  Answer result;
  for (const Vec4f& e : probes->query(queryPoints(run.map)))
    result.estimates.emplace_back(e.x, e.y, e.z);
  result.nrmse = nrmseOf(result.estimates);
  return result;
}

// Half of the 95 % interval of nrmse if other blocks of space had been looked at; empty where there
// is too little light to tell.
std::optional<double> SceneSuite::samplingOf(const std::vector<Vec3f>& estimates) const {
  const std::vector<double> errors = blockErrors(estimates, truth_, setup_.scene.bounds);
  // Against blocks that add up to 1 however they are drawn, the ratio is nrmse itself.
  const std::vector<double> ones(errors.size(), 1.0 / static_cast<double>(errors.size()));
  const std::optional<RatioInterval> interval =
      pairedBootstrapRatio(errors, ones, 1, errors.size());
  if (!interval) return std::nullopt;
  return std::max(interval->high - interval->ratio, interval->ratio - interval->low);
}

// Root of the mean squared difference of two answers, over that of the truth.
double SceneSuite::distance(const Answer& answer, const Answer& from) const {
  double difference = 0, light = 0;
  for (std::size_t i = 0; i < truth_.points.size(); ++i) {
    const Receiver& r = truth_.points[i];
    const double e =
        luminance(Vec3d(answer.estimates[i])) - luminance(Vec3d(from.estimates[i]));
    difference += r.area * e * e;
    light += r.area * luminance(Vec3d(r.a)) * luminance(Vec3d(r.b));
  }
  return light > 0 ? std::sqrt(difference / light) : 0;
}

// nrmse where it is resolved; below its floor it is clamped to 0 and would hide any change.
double SceneSuite::change(const Answer& answer, const Answer& from) const {
  return resolved_ ? answer.nrmse - from.nrmse : distance(answer, from);
}

// The seeds are what everything else is measured against.
void SceneSuite::measureBase() {
  base_answer_ = answer(base());
  floor_ = scoreEstimates(base_answer_.estimates, truth_, ScoredSplit::all).noise_floor.nrmse;
  resolved_ = isResolved(base_answer_.nrmse, floor_);
  sampling_ = samplingOf(base_answer_.estimates);
  double sum = 0, squares = 0;
  for (int i = 1; i < kSeeds; ++i) {
    Run run = base();
    run.seed += static_cast<uint64_t>(i);
    const double moved = change(answer(run), base_answer_);
    sum += moved, squares += moved * moved;
  }
  // Of five values, the base's change is 0; of distances, the root of their mean square.
  const double mean = sum / kSeeds;
  deviation_ = resolved_ ? std::sqrt(std::max(0.0, squares - kSeeds * mean * mean) / (kSeeds - 1.0))
                         : std::sqrt(squares / (kSeeds - 1.0));
  spread_ = std::max(2 * deviation_, sampling_.value_or(0));
}

// What only rounds differently, or has other noise: within 4 deviations of the seeds; at most 5,
// and `more` x nrmse.
Measurement SceneSuite::judged(double change, double bound, const std::string& text, double more) {
  const double most = std::max(bound, 5 * deviation_ + more);
  changes_.push_back(change);
  if (std::abs(change) <= bound) return {Verdict::holds, text, std::nullopt};
  return {std::abs(change) <= most ? Verdict::limit : Verdict::fails,
          std::isfinite(most) ? text + fmt::format("; fails above {:.2g}", most) : text,
          std::abs(change)};
}

Measurement SceneSuite::moved(const Run& run, double more) {
  const double moved = change(answer(run), base_answer_);
  const double bound = std::max(4 * deviation_, 1e-6 * (resolved_ ? base_answer_.nrmse : 1));
  return judged(moved, bound,
                fmt::format("{} {:+.2g}, 4 deviations of the seeds {:.2g}", compared(), moved, bound),
                more);
}

Measurement SceneSuite::sameBits(const Run& run) {
  const bool same = answer(run).estimates == base_answer_.estimates;
  changes_.push_back(0);
  return {same ? Verdict::holds : Verdict::fails, same ? "the same bits" : "different",
          std::nullopt};
}

Measurement SceneSuite::firstUpdate() {
  std::vector<Vec4f> answers[2];
  bool black = true;
  for (auto& after : answers) {
    const auto probes = field(setup_.scene, setup_.embree, base());
    for (const Vec3f& t : probes->irradianceTexels()) black = black && t == Vec3f(0);
    probes->update(0, {}, {});
    after = probes->query(queryPoints({}));
  }
  const bool same = answers[0] == answers[1];
  changes_.push_back(0);
  return {black && same ? Verdict::holds : Verdict::fails,
          fmt::format("{} before it, {} twice", black ? "black" : "not black",
                      same ? "the same bits" : "different"),
          std::nullopt};
}

double SceneSuite::largestAlbedo() const {
  double rho = 0;
  for (const Material& m : setup_.scene.materials)
    rho = std::max(rho, static_cast<double>(maxComponent(m.base_color) * (1 - m.metallic)));
  return std::min(rho, 1.0);
}

// By how much nrmse can change where every texel is off by half an ulp at every bounce; both
// formats may be. No bound where a format clamps.
double SceneSuite::formatShare(const Params& params) const {
  const auto half = [](int format) {
    if (format == PL_FORMAT_RGBA32F) return 0x1p-24;
    if (format == PL_FORMAT_RGBA16F) return 0x1p-11;
    return format == PL_FORMAT_R11G11B10F ? 0x1p-6 : INFINITY;
  };
  const double one = half(params.irradiance_format) + half(params_.irradiance_format);
  return kMoved + one * params.encoding_gamma / (1 - largestAlbedo()) * (1 + base_answer_.nrmse);
}

Scene darkened(Scene scene) {
  for (Light& light : scene.lights) light.intensity = Vec3f(0);
  for (Material& material : scene.materials) {
    material.emission = Vec3f(0);
    material.emission_texture = {};
  }
  scene.sky = {};
  return scene;
}

// The same updates twice, the second time with the light off in between.
Measurement SceneSuite::lightOffAndOn() {
  Run run = base();
  run.params.change_detector = PL_CHANGE_NONE;
  const Scene dark_scene = darkened(setup_.scene);
  const BlendMode mode{.hysteresis = kSwitchHysteresis};
  const auto lit = field(setup_.scene, setup_.embree, run);
  const auto dark = field(dark_scene, setup_.embree, run);
  const auto update = [&](ProbeField& probes, int first) {
    for (int u = 0; u < kSwitched; ++u) probes.update(static_cast<uint64_t>(first + u), mode, mode);
  };
  const auto score = [&](ProbeField& probes) {
    Answer answer;
    double mean = 0;
    for (const Vec4f& e : probes.query(queryPoints({}))) {
      answer.estimates.emplace_back(e.x, e.y, e.z);
      mean += luminance(Vec3d(answer.estimates.back())) / static_cast<double>(truth_.points.size());
    }
    answer.nrmse = nrmseOf(answer.estimates);
    return std::pair(answer, mean);
  };
  for (int i = 0; i < 4; ++i) update(*lit, i * kSwitched);
  const auto [before, lit_mean] = score(*lit);
  dark->setIrradianceTexels(lit->irradianceTexels());
  update(*dark, 0);
  const double left = score(*dark).second / lit_mean;
  lit->setIrradianceTexels(dark->irradianceTexels());
  for (int i = 2; i < 4; ++i) update(*lit, i * kSwitched);
  const double moved = change(score(*lit).first, before);
  // Every update leaves h + (1 - h) rho of what is missing, rho the largest albedo.
  const double kept = std::pow(0.5 + 0.5 * largestAlbedo(), kSwitched);
  const double bound =
      std::max(4 * deviation_, (resolved_ ? base_answer_.nrmse : 1) * kept * kept);
  const std::string text =
      fmt::format("{:.2g} of the light left after {} dark updates (at most {:.2g}), {} {:+.2g}",
                  left, kSwitched, kept, compared(), moved);
  Measurement m = judged(moved, bound, text, kMoved);
  if (!(left <= kept * 1.01 + 1e-3)) m.verdict = Verdict::fails;
  return m;
}

std::vector<RowPlan> SceneSuite::plan() {
  std::vector<RowPlan> rows;
  const std::string tracer = mainTracer() == TracerKind::embree ? "embree" : "rayquery";
  const auto add = [&](const std::string& id, const std::string& title, const std::string& format,
                       const std::string& expectation, std::function<Measurement()> measure) {
    rows.push_back({"scene." + id, title, tracer, format, expectation, std::move(measure)});
  };
  const auto with = [&](const std::function<void(Run&)>& change) {
    Run run = base();
    change(run);
    return [this, run] { return moved(run, kMoved); };
  };
  const std::string noise = "within 4 deviations of the seeds; fails beyond 5 and 1e-3";
  add("seeds", fmt::format("{} seeds", kSeeds), "",
      "the noise of the rays; fails where it hides nrmse: 2 deviations above half of it; a limit "
      "where the truth's own noise hides nrmse",
      [this] {
        if (!resolved_)
          return Measurement{Verdict::limit,
                             fmt::format("nrmse {:.2g} is not above 4 noise floors of {:.2g}; E "
                                         "itself differs by {:.2g} rms between seeds",
                                         base_answer_.nrmse, floor_.value_or(0), deviation_),
                             std::nullopt};
        const bool seen = 2 * deviation_ <= base_answer_.nrmse / 2;
        return Measurement{seen ? Verdict::holds : Verdict::fails,
                           fmt::format("standard deviation {:.2g}", deviation_), std::nullopt};
      });
  add("repeat", "once more", "", "the same bits", [this] { return sameBits(base()); });
  add("threads", "one thread", "", "the same bits", [this] {
    Run run = base();
    run.threads = 1;
    return sameBits(run);
  });
  const Vec3f diagonal(setup_.scene.bounds.diagonal());
  add("translate", "moved by 16 diagonals", "", noise,
      with([&](Run& r) { r.map.shift = diagonal * 16.0f; }));
  add("scale_down", "a hundredth of the size", "", noise,
      with([](Run& r) { r.map.scale = 0.01f; }));
  add("scale_up", "a hundred times the size", "", noise, with([](Run& r) { r.map.scale = 100; }));
  add("mirror", "mirrored in x", "", noise, with([](Run& r) { r.map.mirror = true; }));
  if (options_.tracer == "both" && setup_.gpu.info().ray_query) {
    add("tracer", "the other tracer", "", noise,
        with([](Run& r) { r.tracer = TracerKind::rayquery; }));
    rows.back().tracer = "rayquery";
  }
  add("first_update", "the first update", "", "black before, the same bits twice",
      [this] { return firstUpdate(); });
  add("light_off_on", "light off and on again", "",
      "h + (1 - h) albedo an update; nrmse as before: fails beyond 5 deviations and 1e-3",
      [this] { return lightOffAndOn(); });
  const std::string of_format =
      "within 4 deviations of the seeds; fails beyond 5 and half an ulp x gamma / (1 - albedo); "
      "rgb10a2 ends at 1";
  for (const char* format : {"rgba32f", "rgba16f", "r11g11b10f", "rgb10a2"})
    add(std::string("format/") + format, "another irradiance format", format, of_format, [&] {
      Run run = base();
      setParam(run.params, std::string("irradiance_format=") + format);
      return [this, run] { return moved(run, formatShare(run.params)); };
    }());
  if (params_.visibility != 0)
    for (const char* format : {"rg32f", "rg16f"})
      add(std::string("moments/") + format, "another moment format", format,
          "within 4 deviations of the seeds; how much hangs on visibility is the scene's, but "
          "fails where nrmse doubles",
          [&] {
            Run run = base();
            setParam(run.params, std::string("moment_format=") + format);
            return [this, run] { return moved(run, std::max(base_answer_.nrmse, kMoved)); };
          }());
  return rows;
}

// One sentence: how many digits, and what stands in the way of more.
std::string SceneSuite::trustedText(int digits, bool all) const {
  const double nrmse = base_answer_.nrmse;
  if (!resolved_)
    return fmt::format(
        "No digit of nrmse {:.4g} can be trusted: it is not above 4 times what the truth's own "
        "noise makes of it, {:.2g}; a smaller --rel-error lowers that.",
        nrmse, floor_.value_or(0));
  const bool sampled = sampling_ && spread_ <= *sampling_;
  const std::string mover =
      sampled ? fmt::format("which {} receivers are looked at (95 %; more by --count)",
                            truth_.points.size())
      : all   ? "what must not matter"
              : "what must not matter, of the rows run,";
  if (digits == 0)
    return fmt::format("No digit of nrmse {:.4g} can be trusted: {} moves it by {:.2g}.", nrmse,
                       mover, spread_);
  return fmt::format("The first {} digit{} of nrmse {:.4g} can be trusted ({:.{}g}): {} moves it "
                     "by at most {:.2g}.",
                     digits, digits == 1 ? "" : "s", nrmse, nrmse, digits, mover, spread_);
}

Json SceneSuite::describe(const Json& rows, bool all) const {
  const int digits = resolved_ ? trustedDigits(base_answer_.nrmse, spread_) : 0;
  return {
      {"scene", setup_.scene.name},
      {"state", setup_.scene.state},
      {"probes", options_.field.probes},
      {"receivers", truth_.points.size()},
      {"params", params_.name},
      {"nrmse", base_answer_.nrmse},
      {"seed_deviation", deviation_},
      {"noise_floor", optionalNumber(floor_)},
      {"sampling", optionalNumber(sampling_)},
      {"spread", spread_},
      {"digits", digits},
      {"trusted", trustedText(digits, all)},
      {"cases", rows},
      {"device", setup_.gpu.info().name},
      {"provenance", toJson(setup_.provenance)}};
}

Json SceneSuite::run(const std::string& name) {
  std::vector<RowPlan> rows = plan();
  std::vector<std::string> known;
  for (const RowPlan& row : rows) known.push_back(row.id);
  if (!name.empty())
    std::erase_if(rows, [&](const RowPlan& row) { return !matchesCase(row.id, name); });
  if (rows.empty()) throwInput("--case: no case is called '{}'{}", name, suggestion(name, known));
  Progress progress("stability", static_cast<double>(rows.size() + kSeeds),
                    invocation_.common.quiet);
  measureBase();
  progress.update(kSeeds);
  Json list = Json::array();
  const auto keep = [&](Json row) {
    list.push_back(std::move(row));
    progress.update(static_cast<double>(kSeeds + list.size()));
  };
  const bool interrupted = endsInterrupted([&] { measureRows(rows, keep); });
  progress.finish();
  requireNoValidationMessages(setup_.gpu);
  setup_.provenance.tracer = options_.tracer;
  Json result = describe(list, list.size() == known.size());
  result["interrupted"] = interrupted;
  return result;
}

void SceneSuite::measureRows(const std::vector<RowPlan>& rows,
                             const std::function<void(Json)>& on_row) {
  for (const RowPlan& row : rows) {
    const Timer timer;
    const std::size_t had = changes_.size();
    const Measurement m = row.measure();
    const Json change = changes_.size() > had ? Json(changes_.back()) : Json(nullptr);
    // Formats are the user's choice: they are no reason to trust a digit less.
    if (changes_.size() > had && row.format.empty())
      spread_ = std::max(spread_, std::abs(changes_.back()));
    on_row({{"id", row.id},
            {"group", "scene"},
            {"case", row.title},
            {"tracer", row.tracer},
            {"format", row.format},
            {"expectation", row.expectation},
            {"measured", m.text},
            {"verdict", verdictName(m.verdict)},
            {"change", change},
            {"breaking_point", optionalNumber(m.breaking_point)},
            {"seconds", timer.seconds()}});
  }
}

}  // namespace

Vec3f SceneMap::point(Vec3f p) const {
  if (mirror) p.x = -p.x;
  return p * scale + shift;
}

Vec3f SceneMap::direction(Vec3f d) const {
  if (mirror) d.x = -d.x;
  return d;
}

namespace {

void mapSky(Sky& sky, bool mirror) {
  if (!mirror) return;
  sky.linear.x = -sky.linear.x;
  // u = 0.5 + atan2(d.x, -d.z) / (2 pi): a mirrored direction is at 1 - u.
  const auto width = static_cast<std::ptrdiff_t>(sky.width);
  for (auto row = sky.image.begin(); row != sky.image.end(); row += width)
    std::reverse(row, row + width);
}

}  // namespace

Scene mappedScene(const Scene& scene, const SceneMap& map) {
  Scene result = scene;
  Geometry geometry = *scene.geometry;
  geometry.box = {};
  for (Vec3f& p : geometry.positions) p = map.point(p);
  for (Vec3f& n : geometry.normals) n = map.direction(n);
  for (Triangle& t : geometry.triangles) {
    for (const uint32_t v : t.vertex) geometry.box.extend(geometry.positions[v]);
    if (!map.mirror) continue;
    std::swap(t.vertex[1], t.vertex[2]);
  }
  result.geometry = std::make_shared<const Geometry>(std::move(geometry));
  for (Light& light : result.lights) {
    light.position = map.point(light.position);
    light.direction = map.direction(light.direction);
    light.range *= map.scale;
    if (light.type != LightType::directional) light.intensity *= map.scale * map.scale;
  }
  for (Camera& camera : result.cameras) {
    camera.position = map.point(camera.position);
    camera.forward = map.direction(camera.forward);
    camera.up = map.direction(camera.up);
  }
  for (Vec3f& seed : result.receiver_seeds) seed = map.point(seed);
  mapSky(result.sky, map.mirror);
  const Vec3f a = map.point(scene.bounds.min), b = map.point(scene.bounds.max);
  result.bounds = {componentMin(a, b), componentMax(a, b)};
  result.base_lights.clear(), result.light_colors.clear(), result.light_intensities.clear();
  result.states = {LightingState{}};
  result.states.front().name = result.state;
  return result;
}

int trustedDigits(double value, double spread) {
  if (!(value > 0)) return 0;
  constexpr int kMost = 7;  // of fp32
  if (!(spread > 0)) return kMost;
  const int first = static_cast<int>(std::floor(std::log10(value)));
  int digits = 0;
  while (digits < kMost && 0.5 * std::pow(10.0, first - digits) >= spread) ++digits;
  return digits;
}

Json runSceneStability(const SceneStabilityOptions& options, const std::string& name,
                       const Invocation& invocation) {
  return SceneSuite(options, invocation).run(name);
}

}  // namespace probelab
