// SPDX-License-Identifier: GPL-3.0-or-later
// The `probelab` program: one subcommand a file, see commands.h.
#include "commands.h"
#include "program.h"

int main(int argc, char** argv) {
  probelab::Program program;
  probelab::addInfoCommand(program);
  probelab::addInitCommand(program);
  probelab::addCheckCommand(program);
  probelab::addReferenceCommand(program);
  probelab::addReceiversCommand(program);
  probelab::addPlaceCommand(program);
  probelab::addRenderCommand(program);
  probelab::addEvaluateCommand(program);
  probelab::addCompareCommand(program);
  probelab::addTuneCommand(program);
  probelab::addBenchCommand(program);
  probelab::addBudgetCommand(program);
  probelab::addRunCommand(program);
  probelab::addReportCommand(program);
  probelab::addStabilityCommand(program);
  return program.run(argc, argv);
}
