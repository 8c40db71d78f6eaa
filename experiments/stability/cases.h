// SPDX-License-Identifier: GPL-3.0-or-later
// The groups of hard cases, a file each, with what they are made of.
#pragma once

#include <vector>

#include "workbench.h"

namespace probelab {

std::vector<StabilityCase> geometryCases();
std::vector<StabilityCase> shiftCases();
std::vector<StabilityCase> lightingCases();
std::vector<StabilityCase> brightnessCases();
std::vector<StabilityCase> probeCases();
std::vector<StabilityCase> momentCases();
std::vector<StabilityCase> temporalCases();
std::vector<StabilityCase> queryCases();
std::vector<StabilityCase> formatCases();
std::vector<StabilityCase> fileCases();
std::vector<StabilityCase> placementCases();

}  // namespace probelab
