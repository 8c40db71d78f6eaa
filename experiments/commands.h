// SPDX-License-Identifier: GPL-3.0-or-later
// The subcommands, a file each (cmd_<name>.cpp). Called by main.cpp.
#pragma once

namespace probelab {

class Program;

void addInfoCommand(Program& program);
void addInitCommand(Program& program);
void addCheckCommand(Program& program);
void addReferenceCommand(Program& program);
void addReceiversCommand(Program& program);
void addPlaceCommand(Program& program);
void addRenderCommand(Program& program);
void addEvaluateCommand(Program& program);
void addCompareCommand(Program& program);
void addTuneCommand(Program& program);
void addBenchCommand(Program& program);
void addBudgetCommand(Program& program);
void addRunCommand(Program& program);
void addReportCommand(Program& program);
void addStabilityCommand(Program& program);

}  // namespace probelab
