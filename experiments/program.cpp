// SPDX-License-Identifier: GPL-3.0-or-later
#include "program.h"

#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <vector>

#include "base/build_info.h"
#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/suggest.h"
#include "help.h"

namespace probelab {
namespace {

class HelpFormatter : public CLI::FormatterBase {
 public:
  std::string make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const override {
    return formatHelp(*app,
                      app->get_parent() ? "probelab " + app->get_name() : std::string("probelab"));
  }
};

std::string quoteForShell(const std::string& argument) {
  const bool plain =
      !argument.empty() && argument.find_first_not_of(
                               "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                               "_-+=./,:@%") == std::string::npos;
  if (plain) return argument;
  std::string quoted = "'";
  for (const char c : argument) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

// The folder of the program says nothing about the result, so only its name is kept.
std::string joinCommandLine(int argc, const char* const* argv) {
  std::string line = "probelab";
  for (int i = 1; i < argc; ++i) line += " " + quoteForShell(argv[i]);
  return line;
}

std::vector<std::string> optionNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional()) continue;
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

// The first argument that nothing took, an option before anything else; empty when there is none.
std::string firstUnknown(const CLI::App& app) {
  const std::vector<std::string> left = app.remaining();
  for (const std::string& argument : left)
    if (argument.size() > 1 && argument.front() == '-')
      return argument.substr(0, argument.find('='));
  return left.empty() ? "" : left.front();
}

// CLI11's messages in our words.
std::string readableError(const CLI::ParseError& error) {
  const std::string text = error.what();
  const std::string option = text.substr(0, text.find(':'));
  if (text.find(" required ") != std::string::npos && text.find(" missing") != std::string::npos)
    return option + ": needs a value";
  if (text.find(": At Most 1 required") != std::string::npos) return option + ": given twice";
  const std::string prefix = "Could not convert: ";  // "--count = abc"
  const std::size_t equals = text.find(" = ");
  if (text.rfind(prefix, 0) == 0 && equals != std::string::npos)
    return fmt::format("{}: '{}' is not a value of the right kind",
                       text.substr(prefix.size(), equals - prefix.size()), text.substr(equals + 3));
  return text;
}

// Libraries allocate where they must not throw (nlohmann's json does in destructors): without
// memory that ends in std::terminate. Only calls that need no memory.
[[noreturn]] void onTerminate() {
  try {
    if (const std::exception_ptr current = std::current_exception()) std::rethrow_exception(current);
  } catch (const std::bad_alloc&) {
    std::fputs("probelab: out of memory\n", stderr);
    std::_Exit(1);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "probelab: internal error: %s\n", error.what());
  } catch (...) {
  }
  std::abort();
}

int reportError(const std::string& message, int exit_code) {
  std::fflush(stdout);
  std::string line = message;
  for (char& c : line)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  printToStderr("probelab: " + line + "\n");
  return exit_code;
}

}  // namespace

Program::Program() : app_(std::make_unique<CLI::App>()) {
  app_->name("probelab");
  app_->description(
      "a testbed for irradiance probes: runs probe lighting on Vulkan and scores it against path "
      "tracing");
  app_->formatter(std::make_shared<HelpFormatter>());
  app_->set_help_flag("-h,--help", "print this page; 'probelab COMMAND --help' explains a command");
  app_->set_version_flag("--version", buildInfo().version, "print the version");
  app_->footer("probelab check scenes/cornell/scene.toml");
}

Program::~Program() = default;

CLI::App& Program::addCommand(const std::string& name, const std::string& description,
                              const std::string& example, Body body) {
  CLI::App* command = app_->add_subcommand(name, description);
  command->formatter(app_->get_formatter());
  command->footer(example);
  auto entry = std::make_unique<Command>();
  entry->body = std::move(body);
  addCommonOptions(*command, entry->common);
  commands_[command] = std::move(entry);
  return *command;
}

void Program::throwUsage(const std::string& what) const {
  const std::vector<CLI::App*> chosen = app_->get_subcommands();
  const std::string name = chosen.empty() ? "" : " " + chosen.front()->get_name();
  throwInput("{}{}; see 'probelab{} --help'",
             chosen.empty() ? "" : chosen.front()->get_name() + ": ", what, name);
}

void Program::parse(int argc, const char* const* argv) {
  std::vector<std::string> names;
  for (const CLI::App* command : app_->get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  if (argc < 2) throwInput("name a command: {}; see 'probelab --help'", fmt::join(names, ", "));
  const std::string first = argv[1];
  const bool known = std::find(names.begin(), names.end(), first) != names.end();
  if (!known && first.rfind('-', 0) != 0)
    throwInput("unknown command '{}'{}", first, suggestion(first, names));
  try {
    app_->parse(argc, argv);
  } catch (const CLI::Success&) {
    throw;
  } catch (const CLI::ParseError& error) {
    const std::vector<CLI::App*> chosen = app_->get_subcommands();
    const CLI::App& app = chosen.empty() ? *app_ : *chosen.front();
    const std::string unknown = firstUnknown(app);
    if (unknown.empty()) throwUsage(readableError(error));
    if (unknown.front() == '-')
      throwUsage(
          fmt::format("unknown option '{}'{}", unknown, suggestion(unknown, optionNames(app))));
    throwUsage(fmt::format("'{}' is one argument too many", unknown));
  }
  if (app_->get_subcommands().empty())
    throwInput("name a command: {}; see 'probelab --help'", fmt::join(names, ", "));
}

int Program::run(int argc, const char* const* argv) {
  std::set_terminate(onTerminate);
  try {
    parse(argc, argv);
    const Command& command = *commands_.at(app_->get_subcommands().front());
    installInterruptHandler();
    const ThreadLimit limit(command.common.threads);
    command.body({command.common, joinCommandLine(argc, argv)});
  } catch (const CLI::Success& success) {
    app_->exit(success);  // prints the help page or the version
  } catch (const Error& error) {
    return reportError(error.what(), error.exitCode());
  } catch (const std::bad_alloc&) {
    return reportError("out of memory", 1);
  } catch (const std::exception& error) {
    return reportError(error.what(), 1);
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout))
    return reportError("standard output cannot be written", 1);
  return 0;
}

}  // namespace probelab
