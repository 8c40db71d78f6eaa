// SPDX-License-Identifier: GPL-3.0-or-later
#include "layout_source.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "base/build_info.h"
#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "ddgi/layout_file.h"
#include "input_identity.h"
#include "placement/strategy.h"
#include "placement/training.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;

constexpr double kCachedFromSeconds = 1;
constexpr int kReceiversAProbe = 50, kFewestReceivers = 4096;

// The program itself where it can be read, so that a change that is not committed counts as well.
std::string programIdentity() {
  static const std::string identity = [] {
    try {
      return contentHash(readFile("/proc/self/exe"));
    } catch (const InputError&) {
      return buildInfo().version;
    }
  }();
  return identity;
}

// Without the lighting state: strategies see all train states, whichever is evaluated.
fs::path cachePath(const std::string& folder, const Scene& scene, const Strategy& strategy,
                   const PlacementInput& input) {
  nlohmann::json key = {{"program", programIdentity()},
                        {"scene", scene.content_hash},
                        {"strategy", strategy.name},
                        {"options", input.options},
                        {"probes", input.probes},
                        {"seed", input.seed},
                        {"params", describeParams(input.params)}};
  for (const StrategyOption& option : strategy.options)
    if (const std::string& value = input.options.at(option.name);
        option.range == "FILE" && !value.empty())
      key["files"][option.name] = inputIdentity(value);
  return fs::path(folder) / ("layout-" + contentHash(key.dump()) + ".json");
}

std::optional<ProbeLayout> readCached(const fs::path& path, const Scene& scene) {
  std::error_code ec;
  if (!fs::exists(path, ec)) return std::nullopt;
  try {
    return readLayout(path, scene);
  } catch (const InputError&) {
    return std::nullopt;  // damaged; whatever is in the cache can be made again
  }
}

void writeCached(const fs::path& path, const ProbeLayout& layout, const Scene& scene) {
  std::error_code ec;
  fs::create_directories(path.parent_path(), ec);
  if (ec)
    throwInput("--cache {}: cannot be created: {}", path.parent_path().string(), ec.message());
  writeLayout(path, layout, scene);
}

// Found in the cache (an empty folder holds nothing), or made, and kept where that took long.
// `found_s` grows by what making the found ones once took.
ProbeLayout cachedLayout(const std::string& cache, const Scene& scene, const Strategy& strategy,
                         const PlacementInput& input, double& found_s) {
  const fs::path path = cache.empty() ? "" : cachePath(cache, scene, strategy, input);
  if (!cache.empty())
    if (std::optional<ProbeLayout> found = readCached(path, scene)) {
      found_s += found->build_s;
      return *found;
    }
  const double found_before_s = found_s;
  ProbeLayout layout = placeProbes(strategy.name, input);
  layout.build_s += found_s - found_before_s;
  if (!cache.empty() && layout.build_s > kCachedFromSeconds) writeCached(path, layout, scene);
  return layout;
}

// Of options NAME=VALUE.
std::set<std::string> givenNames(const std::vector<std::string>& pairs) {
  std::set<std::string> names;
  for (const std::string& pair : pairs) names.insert(pair.substr(0, pair.find('=')));
  return names;
}

}  // namespace

Scene trainScene(const Scene& scene) {
  const auto is_train = [](const LightingState& state) { return state.split == Split::train; };
  const auto first = std::find_if(scene.states.begin(), scene.states.end(), is_train);
  if (first == scene.states.end()) return withState(scene, scene.states.front().name);
  Scene result = withState(scene, first->name);
  std::erase_if(result.states, [&](const LightingState& state) { return !is_train(state); });
  return result;
}

int trainReceivers(int probes) {
  return static_cast<int>(std::max<int64_t>(int64_t{kReceiversAProbe} * probes, kFewestReceivers));
}

ProbeLayout obtainLayout(const PlacementScene& of, const FieldOptions& options,
                         const Params& params, uint64_t seed, const std::string& cache,
                         const std::function<void(double)>& progress) {
  if (!options.layout.empty()) return readLayout(options.layout, of.scene);
  const Strategy& strategy = findStrategy(options.strategy);
  const Scene scene = trainScene(of.scene);
  Training training(scene, of.embree, of.reachability,
                    {.receivers = trainReceivers(options.probes), .seed = seed});
  double found_s = 0;
  const auto other = [&](const std::string& name, const PlacementInput& input) {
    return cachedLayout(cache, of.scene, findStrategy(name), input, found_s);
  };
  const PlacementInput input = {.scene = scene,
                                .embree = of.embree,
                                .reachability = of.reachability,
                                .params = params,
                                .training = training,
                                .probes = options.probes,
                                .seed = seed,
                                .options = resolveOptions(strategy, strategyOptionPairs(options)),
                                .given = givenNames(strategyOptionPairs(options)),
                                .progress = progress,
                                .other = other};
  return cachedLayout(cache, of.scene, strategy, input, found_s);
}

}  // namespace probelab
