// SPDX-License-Identifier: GPL-3.0-or-later
// The program's frame: subcommands, common options, error messages and exit codes (0 ok, 1 failed,
// 2 usage or bad input, 3 a requirement is not met, 130 interrupted). Used by main.cpp and tests.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "base/error.h"
#include "common_options.h"

namespace CLI {
class App;
}

namespace probelab {

// What a command knows about how it was called.
struct Invocation {
  const CommonOptions& common;
  std::string command_line;  // as typed, quoted for a shell; part of the provenance
};

// A line for the user on stderr, unless --quiet.
template <class... Args>
void note(const Invocation& invocation, fmt::format_string<Args...> format, Args&&... args) {
  if (invocation.common.quiet) return;
  printToStderr(fmt::format(format, std::forward<Args>(args)...) + "\n");
}

class Program {
 public:
  // Runs the command; a failure is a thrown Error.
  using Body = std::function<void(const Invocation&)>;

  Program();
  ~Program();

  // Registers a subcommand that already has the common options. `example` is one command line.
  CLI::App& addCommand(const std::string& name, const std::string& description,
                       const std::string& example, Body body);

  // Parses, runs one command, prints any error as one line on stderr; returns the exit code.
  int run(int argc, const char* const* argv);

 private:
  struct Command {
    Body body;
    CommonOptions common;
  };
  void parse(int argc, const char* const* argv);
  [[noreturn]] void throwUsage(const std::string& what) const;

  std::unique_ptr<CLI::App> app_;
  std::map<const CLI::App*, std::unique_ptr<Command>> commands_;
};

}  // namespace probelab
