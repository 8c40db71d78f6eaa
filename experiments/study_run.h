// SPDX-License-Identifier: GPL-3.0-or-later
// Runs the cells of a study, each as a process of its own, so that one that fails or crashes takes
// nothing with it. DIR/cells/<id>.json is written whole or not at all; DIR/logs/<id>.txt holds what
// the command said; DIR/files/<id>/ what else it wrote.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "json.h"
#include "program.h"
#include "study.h"

namespace probelab {

struct StudyRun {
  std::filesystem::path folder;
  int jobs = 1;
};

struct StudyFailure {
  const StudyCell* cell;
  std::string error;
};

struct StudyOutcome {
  int done = 0, found = 0;  // computed now; already there
  std::vector<StudyFailure> failures;
  double seconds = 0;
};

std::filesystem::path cellFile(const StudyRun& run, const StudyCell& cell);

// A cell's result if it is there and whole; a damaged file counts as missing.
std::optional<Json> readCell(const StudyRun& run, const StudyCell& cell);

// Seconds that a cell will take: those of the finished cell most alike, scaled by what the options
// say, or a rough guess.
double estimateSeconds(const Study& study, const StudyCell& cell,
                       const std::vector<std::optional<Json>>& results);

// Runs what is missing of the cells, the first ones first; what another run of the study has in
// hand is left to it, and waited for. Failing cells are noted and the rest
// goes on; a signal ends the running ones and throws Interrupted.
StudyOutcome runCells(const Study& study, const std::vector<const StudyCell*>& cells,
                      const StudyRun& run, const Invocation& invocation);

// Every finished cell as one line of CSV: the axes, then the numbers of the results under their
// dotted names. Cells in the study's order.
std::string studyTable(const Study& study, const StudyRun& run);

}  // namespace probelab
