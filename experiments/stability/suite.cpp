// SPDX-License-Identifier: GPL-3.0-or-later
#include "stability/suite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/suggest.h"
#include "base/timer.h"
#include "cases.h"
#include "stability/limits.h"

namespace probelab {
namespace {

std::string rowId(const StabilityCase& of, const CaseVariant& variant) {
  std::string id = of.id;
  for (const std::string& part : {variant.tracer, variant.format})
    if (!part.empty()) id += "/" + part;
  return id;
}

std::string groupOf(const StabilityCase& of) { return of.id.substr(0, of.id.find('.')); }

// '*' stands for any text. Only the last star ever has to take more of the text, so the time is at
// most the product of the lengths.
bool matchesPattern(std::string_view text, std::string_view pattern) {
  std::size_t t = 0, p = 0, after_star = std::string_view::npos, star_end = 0;
  while (t < text.size()) {
    if (p < pattern.size() && pattern[p] == '*')
      after_star = ++p, star_end = t;
    else if (p < pattern.size() && pattern[p] == text[t])
      ++p, ++t;
    else if (after_star != std::string_view::npos)
      p = after_star, t = ++star_end;
    else
      return false;
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

Measurement runGuarded(const PlannedRow& row, Workbench& bench) {
  try {
    return row.of.run(bench, row.variant);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    return {Verdict::fails, std::string("exception: ") + error.what(), std::nullopt};
  }
}

}  // namespace

bool matchesCase(const std::string& id, const std::string& name) {
  return name.empty() || id.starts_with(name) || matchesPattern(id, name);
}

const char* verdictName(Verdict verdict) {
  switch (verdict) {
    case Verdict::holds:
      return "holds";
    case Verdict::limit:
      return "limit";
    case Verdict::fails:
      return "fails";
  }
  return "";
}

std::vector<StabilityCase> stabilityCases() {
  std::vector<StabilityCase> all;
  for (const auto& group :
       {geometryCases, shiftCases, lightingCases, brightnessCases, probeCases, momentCases,
        temporalCases, queryCases, formatCases, fileCases, placementCases})
    for (StabilityCase& of : group()) {
      if (of.variants.empty()) of.variants.push_back({});
      all.push_back(std::move(of));
    }
  return all;
}

std::vector<PlannedRow> planRows(const std::string& name) {
  std::vector<PlannedRow> planned;
  std::vector<std::string> known, groups;
  for (const StabilityCase& of : stabilityCases()) {
    known.push_back(of.id);
    const std::string group = groupOf(of);
    if (std::ranges::find(groups, group) == groups.end()) groups.push_back(group);
    for (const CaseVariant& variant : of.variants) {
      const std::string id = rowId(of, variant);
      if (id != of.id) known.push_back(id);
      if (matchesCase(id, name)) planned.push_back({of, variant, id});
    }
  }
  if (planned.empty()) {
    const std::string nearest = nearestName(name, known);
    if (!nearest.empty())
      throwInput("--case: no case is called '{}', did you mean '{}'?", name, nearest);
    throwInput("--case: no case is called '{}'; groups are: {}", name, fmt::join(groups, ", "));
  }
  return planned;
}

std::vector<StabilityRow> runRows(GpuContext& gpu, const std::vector<PlannedRow>& planned,
                                  const std::function<void(const StabilityRow&)>& on_row) {
  Workbench bench(gpu);
  const RecordedLimits limits = recordedLimits(gpu.info().name);
  std::vector<StabilityRow> rows;
  for (const PlannedRow& row : planned) {
    throwIfInterrupted();
    if (row.variant.tracer == "rayquery" && !gpu.info().ray_query) continue;
    const Timer timer;
    StabilityRow result{row.id,
                        groupOf(row.of),
                        row.of.title,
                        row.variant.tracer,
                        row.variant.format,
                        row.of.expectation,
                        row.of.list,
                        againstRecord(runGuarded(row, bench), row.id, limits),
                        0};
    result.seconds = timer.seconds();
    if (on_row) on_row(result);
    rows.push_back(std::move(result));
  }
  return rows;
}

}  // namespace probelab
