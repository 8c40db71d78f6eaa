// SPDX-License-Identifier: GPL-3.0-or-later
#include "truth.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "base/progress.h"

namespace probelab {
namespace {

constexpr int kMostReceivers = 1 << 24;

std::string checkCount(const std::string& text) {
  const std::string wrong = checkPositiveInteger(text);
  if (!wrong.empty() || std::stod(text) <= kMostReceivers) return wrong;
  return fmt::format("'{}' is more than {} receivers", text, kMostReceivers);
}

namespace fs = std::filesystem;

SampleBudget truthBudget(const TruthOptions& options) {
  SampleBudget fallback;
  fallback.rel_error = 0.02;
  return sampleBudget(options.sampling, fallback);
}

fs::path cachePath(const TruthOptions& options, const SampleBudget& budget, const Scene& scene,
                   const Invocation& invocation) {
  nlohmann::json key = {
      {"truth_version", kTruthVersion}, {"scene", scene.content_hash}, {"state", scene.state},
      {"seed", invocation.common.seed}, {"spp", budget.spp},           {"max_spp", budget.max_spp},
      {"rel_error", budget.rel_error}};
  if (options.points.empty())
    key["count"] = options.count;
  else
    key["points"] = contentHash(readFile(options.points));
  return fs::path(invocation.common.cache) / ("receivers-" + contentHash(key.dump()) + ".json");
}

// A damaged entry is a miss: whatever is in the cache can be computed again.
std::optional<Receivers> readCached(const fs::path& path, const Scene& scene,
                                    const Invocation& invocation) {
  std::error_code ec;
  if (!fs::exists(path, ec)) return std::nullopt;
  try {
    return readReceivers(path, scene);
  } catch (const InputError& error) {
    note(invocation, "warning: cache: {}; computed again", error.what());
    return std::nullopt;
  }
}

void makeCacheFolder(const fs::path& folder) {
  std::error_code ec;
  fs::create_directories(folder, ec);
  if (ec) throwInput("--cache {}: cannot be created: {}", folder.string(), ec.message());
}

}  // namespace

void addTruthOptions(CLI::App& app, TruthOptions& options) {
  CLI::Option* points =
      app.add_option("--points", options.points,
                     "CSV of x,y,z,nx,ny,nz in world coordinates, instead of --count")
          ->type_name("P.csv")
          ->group("Receivers");
  app.add_option("--count", options.count, "receivers: 70 % on surfaces, 30 % in free space")
      ->type_name("N")
      ->check(checkCount)
      ->capture_default_str()
      ->group("Receivers")
      ->excludes(points);
  addSamplingOptions(app, options.sampling, "0.02");
}

Truth obtainTruth(const TruthOptions& options, const Scene& scene, const EmbreeScene& embree,
                  const Reachability& reachability, const Invocation& invocation) {
  const SampleBudget budget = truthBudget(options);
  const fs::path cached = cachePath(options, budget, scene, invocation);
  const bool cacheable = budget.seconds == 0;
  if (cacheable) {
    makeCacheFolder(cached.parent_path());
    if (std::optional<Receivers> found = readCached(cached, scene, invocation))
      return {*found, true};
    checkWritable(cached);
  }
  const uint64_t seed = invocation.common.seed;
  Receivers receivers = options.points.empty()
                            ? generateReceivers(scene, embree, reachability,
                                                static_cast<uint32_t>(options.count), seed)
                            : readReceiverPoints(options.points, scene, embree, reachability);
  receivers.version = buildInfo().version;
  Progress progress("receivers", 1, invocation.common.quiet);
  traceReceivers(receivers, scene, embree, budget, seed,
                 [&](double done) { progress.update(done); });
  progress.finish();
  if (cacheable) writeReceivers(cached, receivers, scene);
  return {std::move(receivers), false};
}

}  // namespace probelab
