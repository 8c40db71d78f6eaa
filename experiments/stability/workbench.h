// SPDX-License-Identifier: GPL-3.0-or-later
// What the cases are made of: scenes in code, fields in them, and the ways to judge a number.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/rng.h"
#include "ddgi/probe_field.h"
#include "ddgi/run_field.h"
#include "scene/scene_builder.h"
#include "stability/suite.h"
#include "trace/path_tracer.h"

namespace probelab {

// A scene with what refers to it.
struct BuiltScene {
  explicit BuiltScene(Scene s) : scene(std::move(s)), embree(scene) {}
  BuiltScene(const BuiltScene&) = delete;
  Scene scene;
  EmbreeScene embree;
};

class Workbench {
 public:
  explicit Workbench(GpuContext& gpu);
  ~Workbench();  // removes the folder
  Workbench(const Workbench&) = delete;

  GpuContext& gpu() { return gpu_; }
  // A temporary folder for files.
  const std::filesystem::path& folder() const { return folder_; }
  // With the variant's tracer, embree where it names none. Throws Interrupted.
  std::unique_ptr<ProbeField> field(const BuiltScene& scene, const ProbeLayout& layout,
                                    const Params& params, const CaseVariant& variant = {},
                                    uint64_t seed = 0);
  // Closest hits by the variant's tracer.
  std::vector<Hit> closest(const BuiltScene& scene, std::span<const Ray> rays,
                           const CaseVariant& variant);

 private:
  GpuContext& gpu_;
  std::filesystem::path folder_;
};

// Variants of a case.
std::vector<CaseVariant> bothTracers();
std::vector<CaseVariant> bothTracersAndReference();
std::vector<CaseVariant> irradianceFormats();

// A preset with 32-bit atlases, or with the irradiance format of that name.
Params exactParams(const std::string& preset);
Params formatParams(const std::string& preset, const std::string& format);
int formatOf(const std::string& name);  // PL_FORMAT_* of irradiance

// Every point of a lattice in the box is a probe.
ProbeLayout fullLattice(const Box3f& box, const Vec3i& count, const Box3f& bounds);

// (0,0,0) to (2,2,2), walls facing in; all emit and reflect alike: E = pi Le / (1 - albedo).
Scene furnace(float albedo, float emission, float size = 2);
ProbeLayout furnaceLayout(const Scene& scene, int count = 2);
// Places on the walls and in the air of the furnace, normals away from walls.
std::vector<QueryPoint> furnacePoints(float size = 2);

QueryPoint upAt(const Vec3f& position);
std::vector<QueryPoint> randomPoints(const Box3f& box, int count, uint64_t seed);
Vec3f randomDirection(Rng& rng);

// Irradiance (green) at points, and the reference's standard error (0 for fields).
struct Answers {
  std::vector<double> e, error;
};
// By the variant's path tracer with `samples`, or a field of `params` after `updates`.
struct AnswerSettings {
  uint32_t samples = 256;
  uint64_t updates = 3;
};
Answers answersAt(Workbench& bench, const BuiltScene& scene, const ProbeLayout& layout,
                  const Params& params, std::span<const QueryPoint> points,
                  const CaseVariant& variant, const AnswerSettings& settings = {});
// Holds where every answer is within `bound` of the truth, the reference's within 5 standard errors
// (a share of 1e-5 is rounding).
Measurement near(const Answers& answers, const std::vector<double>& truth, double bound);
// The same of two, of either kind.
Measurement near(const Answers& answers, const Answers& other, double bound);

// The larger and the smaller of two, and NaN where either is: a number that is none must not get
// lost on the way to a judgement.
double larger(double a, double b);
double smaller(double a, double b);
double largestOf(std::span<const double> values);

// Largest relative difference of green from `truth`, and largest difference over the largest value.
double worstError(std::span<const Vec4f> answers, double truth);
double worstDifference(std::span<const Vec4f> a, std::span<const Vec4f> b);

// One probe at the middle of the bounds, one update of 4096 rays from black: largest difference of
// its texels from the irradiance of `radiance` (of a direction).
double probeError(Workbench& bench, const BuiltScene& scene, const CaseVariant& variant,
                  const std::function<double(const Vec3d&)>& radiance);
constexpr double kProbeStratum = 4 * std::numbers::pi / 4096;  // solid angle of a ray

// Judgements. `within` holds where value <= bound, so not for NaN.
Measurement within(double value, double bound, const std::string& what = "");
Measurement checked(bool holds, const std::string& text);
// A point that was measured; beyond `wanted` nothing breaks any more.
Measurement limitAt(double point, const std::string& text);
// Holds where `action` throws an InputError whose text has all of `parts`, in one line.
Measurement refused(const std::function<void()>& action, const std::vector<std::string>& parts);
// The worse of two, texts joined.
Measurement both(const Measurement& a, const Measurement& b);

// The x in [low, high] at which `holds` turns from true at `low` to false, to a relative
// `accuracy`, halving logarithms. Throws Error when it does not hold at `low`; `high` where it
// holds there too. Can be interrupted.
double breakingPoint(double low, double high, const std::function<bool(double)>& holds,
                     double accuracy = 0.05);

}  // namespace probelab
