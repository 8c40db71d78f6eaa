// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/suggest.h"
#include "base/timer.h"
#include "placement/grid.h"
#include "placement/lattices.h"
#include "placement/optimized.h"
#include "placement/random_layouts.h"
#include "placement/strategy.h"
#include "placement/training.h"

namespace probelab {
namespace {

constexpr int kMaxProbes = 1 << 24;

const std::string& optionValue(const PlacementInput& input, const std::string& name) {
  const auto found = input.options.find(name);
  PROBELAB_CHECK(found != input.options.end());
  return found->second;
}

std::vector<std::string> optionNames(const Strategy& strategy) {
  std::vector<std::string> names;
  for (const StrategyOption& option : strategy.options) names.push_back(option.name);
  return names;
}

[[noreturn]] void unknownOption(const Strategy& strategy, const std::string& name) {
  const std::vector<std::string> names = optionNames(strategy);
  if (names.empty()) throwInput("--option {}: strategy '{}' has no options", name, strategy.name);
  throwInput("--option {}: strategy '{}' has no such option{}", name, strategy.name,
             suggestion(name, names));
}

bool hasOption(const Strategy& strategy, const std::string& name) {
  return std::ranges::any_of(strategy.options, [&](const auto& o) { return o.name == name; });
}

}  // namespace

double numberOption(const PlacementInput& input, const std::string& name, double least,
                    double most, const std::string& word) {
  const std::string& text = optionValue(input, name);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool read = error == std::errc() && end == text.data() + text.size();
  if (!read || !(value >= least && value <= most))
    throwInput("--option {}={}: {}a number from {:g} to {:g} is needed", name, text,
               word.empty() ? word : word + " or ", least, most);
  return value;
}

int integerOption(const PlacementInput& input, const std::string& name, int least, int most) {
  const std::string& text = optionValue(input, name);
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool read = error == std::errc() && end == text.data() + text.size();
  if (!read || value < least || value > most)
    throwInput("--option {}={}: a whole number from {} to {} is needed", name, text, least, most);
  return value;
}

int choiceOption(const PlacementInput& input, const std::string& name,
                 const std::vector<std::string>& names) {
  const std::string& text = optionValue(input, name);
  const auto found = std::ranges::find(names, text);
  if (found == names.end())
    throwInput("--option {}={}: unknown value{}", name, text, suggestion(text, names));
  return static_cast<int>(found - names.begin());
}

std::span<const Strategy> strategies() {
  static const std::vector<Strategy> all = {
      kGridStrategy,      kGridBestStrategy, kGridSparseStrategy,
#ifdef PROBELAB_WITH_CGAL
      kOptimizedStrategy, kRelocatedStrategy,
#endif
      kJitteredStrategy,  kPoissonStrategy,  kPoissonBestStrategy, kFileStrategy};
  return all;
}

const Strategy& findStrategy(const std::string& name) {
  std::vector<std::string> names;
  for (const Strategy& candidate : strategies()) {
    if (candidate.name == name) return candidate;
    names.push_back(candidate.name);
  }
  throwInput("unknown strategy '{}'{}", name, suggestion(name, names));
}

OptionValues resolveOptions(const Strategy& strategy, const std::vector<std::string>& pairs) {
  OptionValues values;
  for (const std::string& pair : pairs) {
    const std::size_t equals = pair.find('=');
    if (equals == std::string::npos || equals == 0)
      throwInput("--option {}: NAME=VALUE is needed", pair);
    const std::string name = pair.substr(0, equals);
    if (!hasOption(strategy, name)) unknownOption(strategy, name);
    if (!values.emplace(name, pair.substr(equals + 1)).second)
      throwInput("--option {}: given twice", name);
  }
  for (const StrategyOption& option : strategy.options)
    values.emplace(option.name, option.fallback);
  return values;
}

ProbeLayout otherLayout(const std::string& strategy, const PlacementInput& input) {
  PlacementInput of_other = input;
  of_other.options = resolveOptions(findStrategy(strategy), {});
  of_other.given = {};
  return input.other ? input.other(strategy, of_other) : placeProbes(strategy, of_other);
}

ProbeLayout placeProbes(const std::string& strategy_name, const PlacementInput& input) {
  const Strategy& strategy = findStrategy(strategy_name);
  if (input.probes < 1 || input.probes > kMaxProbes)
    throwInput("--probes {}: a layout takes 1 to {} probes", input.probes, kMaxProbes);
  for (const auto& [name, value] : input.options)
    if (!hasOption(strategy, name)) unknownOption(strategy, name);
  PlacementInput complete = input;
  for (const StrategyOption& option : strategy.options)
    complete.options.emplace(option.name, option.fallback);

  const Timer timer;
  const uint64_t evaluations = input.training.evaluations();
  ProbeLayout layout = strategy.place(complete);
  layout.strategy = strategy.name;
  layout.asked = input.probes;
  layout.seed = input.seed;
  // A layout that was read back has its own weights: it says which options it took.
  if (layout.options.empty()) layout.options = complete.options;
  layout.evaluations = std::max(layout.evaluations, input.training.evaluations() - evaluations);
  layout.build_s = timer.seconds();
  return layout;
}

}  // namespace probelab
