// SPDX-License-Identifier: GPL-3.0-or-later
// The hard-case suite: small scenes, damaged files and odd numbers, each with an outcome that is
// known from outside the program, and what was measured. `probelab stability` prints it, a test
// holds every row.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gpu/context.h"

namespace probelab {

// limit: what is asked for does not hold everywhere; the point where it ends was measured.
enum class Verdict { holds, limit, fails };
const char* verdictName(Verdict verdict);

struct Measurement {
  Verdict verdict = Verdict::fails;
  std::string text;                      // "2.1e-07, bound 1e-05"
  std::optional<double> breaking_point;  // of a limit; its unit is in the text
};

// What a case is run with; empty where it does not matter.
struct CaseVariant {
  std::string tracer;  // embree | rayquery | reference (the path tracer)
  std::string format;  // of the irradiance or the moments, or what else is varied (a preset)
};

class Workbench;

struct StabilityCase {
  std::string id;           // "geometry.scale"; what is before the dot is its group
  std::string title;        // the case, a few words
  std::string expectation;  // with where the bound comes from
  std::string list;         // numbers in the published lists of hard cases: "G8 P19"
  std::vector<CaseVariant> variants;
  Measurement (*run)(Workbench& bench, const CaseVariant& variant);
};

// By group; ids are unique.
std::vector<StabilityCase> stabilityCases();

struct StabilityRow {
  std::string id;  // the case's, "/tracer" and "/format" behind it
  std::string group, title, tracer, format, expectation, list;
  Measurement measured;
  double seconds = 0;
};

// The rows that a name asks for: a row's or a case's id, the beginning of one ("geometry"), or a
// pattern with '*'. Empty: all. Throws InputError with the nearest names where there is none.
bool matchesCase(const std::string& id, const std::string& name);
struct PlannedRow {
  StabilityCase of;
  CaseVariant variant;
  std::string id;
};
std::vector<PlannedRow> planRows(const std::string& name);

// Runs them in order. An exception of a case is a row that fails. Rows of the tracer rayquery are
// left out where the device has none. `on_row` comes after each.
std::vector<StabilityRow> runRows(GpuContext& gpu, const std::vector<PlannedRow>& planned,
                                  const std::function<void(const StabilityRow&)>& on_row = {});

}  // namespace probelab
