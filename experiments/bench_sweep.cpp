// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "base/timer.h"
#include "table.h"

namespace probelab {
namespace {

constexpr int kFewestProbes = 256, kRaysOfProbes = 64;
constexpr int kFewestRays = 16, kProbesOfRays = 512, kProbesARay = 32;
constexpr int kSweepRounds = 7;
constexpr const char* kStages[] = {"update",  "generate", "trace", "shade",
                                   "occlude", "resolve",  "blend"};

struct Size {
  int probes, rays;
};
struct SizeTimes {
  Size wanted{};
  uint32_t probes = 0;  // active
  std::unique_ptr<ProbeField> field;
  std::map<std::string, std::vector<double>> ms;
};

std::vector<Size> probeSizes(int most_probes) {
  std::vector<Size> sizes;
  for (int n = kFewestProbes; n <= most_probes; n *= 2) sizes.push_back({n, kRaysOfProbes});
  return sizes;
}

std::vector<Size> raySizes(int most_probes) {
  std::vector<Size> sizes;
  for (int n = kFewestRays; n <= most_probes / kProbesARay; n *= 2)
    sizes.push_back({kProbesOfRays, n});
  return sizes;
}

void timeOnce(SizeTimes& size, int round) {
  throwIfInterrupted();
  ProbeField& field = *size.field;
  const BlendMode mode{.hysteresis = static_cast<float>(field.params().hysteresis)};
  field.update(static_cast<uint64_t>(2 * round), mode, mode);  // warms up
  field.update(static_cast<uint64_t>(2 * round + 1), mode, mode);
  size.ms["update"].push_back(field.updateWallMs());
  for (const auto& [stage, ms] : field.updateStages()) size.ms[stage].push_back(ms);
}

std::vector<SizeTimes> timeSizes(SceneSetup& setup, const Params& params,
                                 const FieldOptions& options, const std::vector<Size>& sizes,
                                 const Invocation& invocation) {
  std::vector<SizeTimes> times;
  for (const Size& wanted : sizes) {
    Params sized = params;
    setParam(sized, fmt::format("rays={}", wanted.rays));
    FieldOptions sized_options = options;
    sized_options.probes = wanted.probes;
    SizeTimes next{wanted, 0, nullptr, {}};
    next.field = makeField(setup, sized,
                           {.options = sized_options,
                            .seed = invocation.common.seed,
                            .cache = invocation.common.cache,
                            .accumulate = false});
    next.probes = next.field->states().activeCount();
    times.push_back(std::move(next));
  }
  Progress progress("sweep", kSweepRounds, invocation.common.quiet);
  for (int round = 0; round < kSweepRounds; ++round) {
    for (SizeTimes& size : times) timeOnce(size, round);
    progress.update(round + 1);
  }
  progress.finish();
  return times;
}

Json fitsJson(const std::vector<SizeTimes>& times, bool by_probes) {
  Json fits = Json::object();
  for (const char* stage : kStages) {
    std::vector<double> x, y;
    for (const SizeTimes& size : times) {
      const auto found = size.ms.find(stage);
      const double ms = found == size.ms.end() ? 0 : percentile(found->second, 0.5);
      if (!(ms > 0)) continue;
      x.push_back(by_probes ? size.probes : size.wanted.rays);
      y.push_back(ms);
    }
    if (x.size() < 3 || x.front() == x.back()) continue;
    const LineFit fit = fitLine(x, y);
    fits[stage] = {{"a_ms", fit.a},
                   {"b_us", fit.b * 1e3},
                   {"r2", fit.r2},
                   {"largest_residual", fit.largest_relative_residual}};
  }
  return fits;
}

Json sweepJson(const std::vector<SizeTimes>& times, bool by_probes) {
  Json points = Json::array();
  for (const SizeTimes& size : times)
    points.push_back({{"probes", size.probes},
                      {"rays", size.wanted.rays},
                      {"update_ms", percentile(size.ms.at("update"), 0.5)}});
  return {{"points", points}, {"fits", fitsJson(times, by_probes)}};
}

std::string formatPart(const Json& part, const std::string& unit) {
  std::string text = fmt::format("\nUpdate against {}s\n", unit);
  TextTable points({"probes", "rays", "update ms"});
  for (const Json& p : part["points"])
    points.addRow(
        {p["probes"].dump(), p["rays"].dump(), formatNumber(p["update_ms"].get<double>())});
  TextTable fits({"a + b n", "a ms", "b us/" + unit, "R2", "largest residual"});
  for (const auto& [stage, fit] : part["fits"].items())
    fits.addRow({stage, formatNumber(fit["a_ms"].get<double>()),
                 formatNumber(fit["b_us"].get<double>()),
                 fmt::format("{:.5f}", fit["r2"].get<double>()),
                 fmt::format("{:.1f} %", 100 * fit["largest_residual"].get<double>())});
  return text + points.text() + "\n" + fits.text();
}

}  // namespace

LineFit fitLine(std::span<const double> x, std::span<const double> y) {
  PROBELAB_CHECK_EQ(x.size(), y.size());
  double w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0, mean = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double weight = 1 / (y[i] * y[i]);
    w += weight, wx += weight * x[i], wy += weight * y[i];
    wxx += weight * x[i] * x[i], wxy += weight * x[i] * y[i];
    mean += y[i] / static_cast<double>(y.size());
  }
  const double determinant = w * wxx - wx * wx;
  PROBELAB_CHECK(determinant > 0);
  LineFit fit;
  fit.b = (w * wxy - wx * wy) / determinant;
  fit.a = (wy - fit.b * wx) / w;
  double residual = 0, total = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double off = fit.a + fit.b * x[i] - y[i];
    residual += off * off, total += (y[i] - mean) * (y[i] - mean);
    fit.largest_relative_residual = std::max(fit.largest_relative_residual, std::abs(off) / y[i]);
  }
  fit.r2 = total > 0 ? 1 - residual / total : 1;
  return fit;
}

Json runSweep(SceneSetup& setup, const Params& params, const FieldOptions& options, int most_probes,
              const Invocation& invocation) {
  const auto probes = timeSizes(setup, params, options, probeSizes(most_probes), invocation);
  Json result = {{"probes", sweepJson(probes, true)}};
  const auto rays = timeSizes(setup, params, options, raySizes(most_probes), invocation);
  result["rays"] = sweepJson(rays, false);
  return result;
}

std::string formatSweep(const Json& sweep) {
  return formatPart(sweep["probes"], "probe") + formatPart(sweep["rays"], "ray");
}

}  // namespace probelab
