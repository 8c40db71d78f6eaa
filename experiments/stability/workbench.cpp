// SPDX-License-Identifier: GPL-3.0-or-later
#include "workbench.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/rng.h"
#include "closed_forms.h"
#include "ddgi/texels.h"
#include "shared/octahedral.h"

namespace probelab {
namespace {

using std::numbers::pi;

namespace fs = std::filesystem;

constexpr const char* kFormats[] = {"rgba32f", "rgba16f", "r11g11b10f", "rgb10a2"};
constexpr std::size_t kLongestMessage = 110;

TracerKind tracerOf(const CaseVariant& variant) {
  return variant.tracer == "rayquery" ? TracerKind::rayquery : TracerKind::embree;
}

Verdict worse(Verdict a, Verdict b) { return std::max(a, b); }

}  // namespace

Workbench::Workbench(GpuContext& gpu) : gpu_(gpu) {
  const char* temporary = std::getenv("TMPDIR");
  std::string pattern = (fs::path(temporary != nullptr && *temporary != '\0' ? temporary : "/tmp") /
                         "probelab_stability_XXXXXX")
                            .string();
  if (mkdtemp(pattern.data()) == nullptr)
    throw Error(fmt::format("{}: cannot create a temporary folder; set TMPDIR", pattern));
  folder_ = pattern;
}

Workbench::~Workbench() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

std::unique_ptr<ProbeField> Workbench::field(const BuiltScene& scene, const ProbeLayout& layout,
                                             const Params& params, const CaseVariant& variant,
                                             uint64_t seed) {
  throwIfInterrupted();
  FieldSettings settings;
  settings.seed = seed;
  settings.tracer = tracerOf(variant);
  settings.working_set_bytes = uint64_t{16} << 20;
  return std::make_unique<ProbeField>(gpu_, scene.scene, scene.embree, layout, params, settings);
}

std::vector<Hit> Workbench::closest(const BuiltScene& scene, std::span<const Ray> rays,
                                    const CaseVariant& variant) {
  RayBatch batch(gpu_, scene.scene, scene.embree, tracerOf(variant),
                 static_cast<uint32_t>(rays.size()));
  StageRecorder recorder(gpu_);
  batch.uploadRays(rays);
  batch.traceSurfaces(recorder, static_cast<uint32_t>(rays.size()));
  recorder.flush();
  return downloadArray<Hit>(gpu_, batch.buffers().hits, rays.size());
}

std::vector<CaseVariant> bothTracers() { return {{"embree", ""}, {"rayquery", ""}}; }

std::vector<CaseVariant> bothTracersAndReference() {
  return {{"reference", ""}, {"embree", ""}, {"rayquery", ""}};
}

std::vector<CaseVariant> irradianceFormats() {
  std::vector<CaseVariant> variants;
  for (const char* format : kFormats) variants.push_back({"", format});
  return variants;
}

Params exactParams(const std::string& preset) {
  Params params = loadParams(preset);
  params.irradiance_format = PL_FORMAT_RGBA32F;
  params.moment_format = PL_FORMAT_RG32F;
  params.rounding = 0;
  return params;
}

Params formatParams(const std::string& preset, const std::string& format) {
  Params params = exactParams(preset);
  setParam(params, "irradiance_format=" + format);
  return params;
}

int formatOf(const std::string& name) { return formatParams("rtxgi", name).irradiance_format; }

ProbeLayout fullLattice(const Box3f& box, const Vec3i& count, const Box3f& bounds) {
  const Lattice lattice = makeLattice(box, count);
  ProbeLayout layout = latticeLayout(
      lattice, bounds, std::vector<uint8_t>(static_cast<std::size_t>(lattice.pointCount()), 1));
  layout.strategy = "lattice";
  return layout;
}

Scene furnace(float albedo, float emission, float size) {
  SceneBuilder builder;
  builder.box(Vec3f(0), Vec3f(size), builder.material(Vec3f(albedo), Vec3f(emission)), true);
  return builder.finish();
}

ProbeLayout furnaceLayout(const Scene& scene, int count) {
  const Box3f& box = scene.geometry->box;
  const Vec3f inset = box.extent() * 0.2f;
  return fullLattice({box.min + inset, box.max - inset}, Vec3i(count, count, count), scene.bounds);
}

std::vector<QueryPoint> furnacePoints(float size) {
  std::vector<QueryPoint> points{upAt(Vec3f(1, 0, 1)), upAt(Vec3f(0.3f, 0, 1.9f)),
                                 upAt(Vec3f(1.1f, 0.7f, 0.4f))};
  points.push_back({Vec3f(2, 0.3f, 1), Vec3f(-1, 0, 0), Vec3f(1, 0, 0)});
  points.push_back({Vec3f(0.6f, 1.2f, 0), Vec3f(0, 0, 1), Vec3f(0, 0, -1)});
  for (QueryPoint& p : points) p.position = p.position * (size / 2);
  return points;
}

QueryPoint upAt(const Vec3f& position) { return {position, Vec3f(0, 1, 0), Vec3f(0, -1, 0)}; }

Vec3f randomDirection(Rng& rng) {
  const double z = 1 - 2 * rng.nextDouble(), phi = 2 * pi * rng.nextDouble();
  const double s = std::sqrt(std::max(0.0, 1 - z * z));
  return Vec3f(Vec3d(s * std::cos(phi), s * std::sin(phi), z));
}

std::vector<QueryPoint> randomPoints(const Box3f& box, int count, uint64_t seed) {
  Rng rng(seed, RngStream::stability);
  std::vector<QueryPoint> points;
  for (int i = 0; i < count; ++i) {
    const float x = rng.nextFloat(), y = rng.nextFloat(), z = rng.nextFloat();
    const Vec3f normal = randomDirection(rng);
    points.push_back({box.min + Vec3f(x, y, z) * box.extent(), normal, -normal});
  }
  return points;
}

Answers answersAt(Workbench& bench, const BuiltScene& scene, const ProbeLayout& layout,
                  const Params& params, std::span<const QueryPoint> points,
                  const CaseVariant& variant, const AnswerSettings& settings) {
  Answers answers;
  if (variant.tracer != "reference") {
    const auto field = bench.field(scene, layout, params, variant);
    for (uint64_t u = 0; u < settings.updates; ++u) field->update(u, {}, {});
    for (const Vec4f& e : field->query(points)) answers.e.push_back(static_cast<double>(e.y));
    answers.error.resize(points.size(), 0);
    return answers;
  }
  std::vector<IrradiancePoint> places;
  for (const QueryPoint& p : points) places.push_back({p.position, p.normal});
  const IrradianceEstimate estimate =
      estimateIrradiance(scene.scene, scene.embree, places, {.spp = settings.samples}, 1);
  for (std::size_t i = 0; i < places.size(); ++i) {
    answers.e.push_back(
        0.5 * (static_cast<double>(estimate.a[i].y) + static_cast<double>(estimate.b[i].y)));
    answers.error.push_back(static_cast<double>(estimate.standard_error[i].y));
  }
  return answers;
}

Measurement near(const Answers& answers, const Answers& other, double bound) {
  double worst = 0, sigmas = 0;
  bool sampled = false;
  for (std::size_t i = 0; i < answers.e.size(); ++i) {
    const double difference = std::abs(answers.e[i] - other.e[i]);
    const double scale = std::max(std::abs(other.e[i]), 1e-30);
    const double error = std::hypot(answers.error[i], other.error[i]);
    sampled = sampled || error != 0;
    worst = larger(worst, difference / scale);
    sigmas = larger(sigmas, difference / std::hypot(error, 1e-5 * scale));
  }
  if (!sampled) return within(worst, bound, "error");
  return {sigmas <= 5 ? Verdict::holds : Verdict::fails,
          fmt::format("{:.2f} standard errors ({:.2g}), bound 5", sigmas, worst), std::nullopt};
}

Measurement near(const Answers& answers, const std::vector<double>& truth, double bound) {
  return near(answers, Answers{truth, std::vector<double>(truth.size(), 0.0)}, bound);
}

double larger(double a, double b) { return std::isnan(a) || a >= b ? a : b; }
double smaller(double a, double b) { return std::isnan(a) || a <= b ? a : b; }

double largestOf(std::span<const double> values) {
  double most = -INFINITY;
  for (const double v : values) most = larger(most, v);
  return most;
}

double worstError(std::span<const Vec4f> answers, double truth) {
  double worst = 0;
  for (const Vec4f& e : answers)
    worst = larger(worst, std::abs(static_cast<double>(e.y) - truth) / std::abs(truth));
  return worst;
}

double worstDifference(std::span<const Vec4f> a, std::span<const Vec4f> b) {
  double worst = 0, top = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Vec3d va(Vec3f(a[i].x, a[i].y, a[i].z)), vb(Vec3f(b[i].x, b[i].y, b[i].z));
    worst = larger(worst, length(va - vb));
    top = larger(top, length(va));
  }
  return top > 0 ? worst / top : worst;
}

double probeError(Workbench& bench, const BuiltScene& scene, const CaseVariant& variant,
                  const std::function<double(const Vec3d&)>& radiance) {
  Params params = exactParams("probelab");
  params.rays = 4096;
  const Box3f& bounds = scene.scene.bounds;
  const auto field =
      bench.field(scene, fullLattice(bounds, Vec3i(1, 1, 1), bounds), params, variant);
  field->update(0, {}, {});
  const int n = atlasSides(params).irradiance;
  std::vector<Vec3d> normals;
  for (int t = 0; t < n * n; ++t) normals.push_back(texelDirection<double>(t % n, t / n, n));
  const std::vector<double> truth = irradianceOf(normals, radiance);
  const std::vector<Vec3f> texels = field->irradianceTexels();
  double worst = 0;
  for (std::size_t t = 0; t < truth.size(); ++t)
    worst = larger(worst, std::abs(pi * static_cast<double>(texels[t].y) - truth[t]));
  return worst;
}

Measurement within(double value, double bound, const std::string& what) {
  return {value <= bound ? Verdict::holds : Verdict::fails,
          fmt::format("{}{}{:.3g}, bound {:.3g}", what, what.empty() ? "" : " ", value, bound),
          std::nullopt};
}

Measurement checked(bool holds, const std::string& text) {
  return {holds ? Verdict::holds : Verdict::fails, text, std::nullopt};
}

Measurement limitAt(double point, const std::string& text) { return {Verdict::limit, text, point}; }

Measurement refused(const std::function<void()>& action, const std::vector<std::string>& parts) {
  std::string message;
  try {
    action();
    return checked(false, "accepted");
  } catch (const InputError& error) {
    message = error.what();
  }
  std::string shown = message;
  if (const std::size_t slash = shown.find(": "); slash != std::string::npos && shown[0] == '/')
    shown = fs::path(shown.substr(0, slash)).filename().string() + shown.substr(slash);
  if (shown.size() > kLongestMessage) shown = shown.substr(0, kLongestMessage) + "...";
  for (const std::string& part : parts)
    if (message.find(part) == std::string::npos)
      return checked(false, fmt::format("the error lacks '{}': {}", part, shown));
  return checked(message.find('\n') == std::string::npos, "error: " + shown);
}

Measurement both(const Measurement& a, const Measurement& b) {
  return {worse(a.verdict, b.verdict), a.text + "; " + b.text,
          a.breaking_point ? a.breaking_point : b.breaking_point};
}

double breakingPoint(double low, double high, const std::function<bool(double)>& holds,
                     double accuracy) {
  const auto holds_at = [&](double x) {
    throwIfInterrupted();
    return holds(x);
  };
  if (!holds_at(low)) throw Error(fmt::format("does not even hold at {:g}", low));
  if (holds_at(high)) return high;
  while (std::abs(std::log(high / low)) > accuracy) {
    const double middle = std::sqrt(low * high);
    (holds_at(middle) ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

}  // namespace probelab
