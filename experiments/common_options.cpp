// SPDX-License-Identifier: GPL-3.0-or-later
#include "common_options.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "base/error.h"
#include "base/files.h"
#include "help.h"
#include "require.h"

namespace probelab {
namespace {

bool environmentSwitch(const char* name) {
  const char* value = std::getenv(name);
  return value && *value && std::string(value) != "0";
}

// False unless the whole of `text` is a number.
bool parseNumber(const std::string& text, double& value) {
  char* end = nullptr;
  value = std::strtod(text.c_str(), &end);
  return !text.empty() && *end == '\0' && std::isfinite(value);
}

}  // namespace

void addCommonOptions(CLI::App& app, CommonOptions& options) {
  app.set_help_flag("-h,--help", "print this page")->group(kCommonGroup);
  app.add_flag("--json", options.json,
               "print one JSON object on stdout instead of a table; everything else goes to stderr")
      ->group(kCommonGroup);
  app.add_option("--seed", options.seed, "seed of every random number")
      ->group(kCommonGroup)
      ->type_name("N")
      ->check(checkSeed)
      ->capture_default_str();
  app.add_option("--device", options.device,
                 "Vulkan device: its index or a part of its name, see 'probelab info' "
                 "(default: the first that can run everything)")
      ->group(kCommonGroup)
      ->type_name("NAME");
  app.add_option("--threads", options.threads, "threads on the host, 0 for all of the machine's")
      ->group(kCommonGroup)
      ->type_name("N")
      ->check(CLI::Range(0, 4096).description(""))
      ->capture_default_str();
  app.add_option("--cache", options.cache, "folder for what is computed once, keyed by content")
      ->group(kCommonGroup)
      ->type_name("DIR")
      ->capture_default_str();
  app.add_flag("--validation", options.validation,
               "run under the Vulkan validation layers; any message fails the command (also by the "
               "environment variable PROBELAB_VALIDATION=1)")
      ->group(kCommonGroup);
  app.add_flag("--quiet", options.quiet, "no progress and no notes on stderr")->group(kCommonGroup);
  options.validation = environmentSwitch("PROBELAB_VALIDATION");
  addRequireOption(app, options.require);
}

void addSceneArgument(CLI::App& app, std::string& scene) {
  app.add_option("SCENE", scene, "a glTF or GLB file, or a scene TOML")->required();
}

void addOutputOption(CLI::App& app, std::string& output, const std::string& type,
                     const std::string& description, bool required) {
  app.add_option("-o,--output", output, description)
      ->type_name(type)
      ->required(required)
      ->group("Output");
}

std::string checkPositive(const std::string& text) {
  double value = 0;
  if (parseNumber(text, value) && value > 0) return "";
  return "'" + text + "' is not a number above 0";
}

std::string checkNotNegative(const std::string& text) {
  double value = 0;
  if (parseNumber(text, value) && value >= 0) return "";
  return "'" + text + "' is not a number from 0 on";
}

std::string checkPositiveInteger(const std::string& text) {
  double value = 0;
  if (parseNumber(text, value) && value >= 1 && value == std::floor(value) &&
      value <= std::numeric_limits<int>::max())
    return "";
  return "'" + text + "' is not a whole number above 0";
}

std::string checkFinite(const std::string& text) {
  double value = 0;
  return parseNumber(text, value) ? "" : "'" + text + "' is not a number";
}

std::string checkSeed(const std::string& text) {
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size()) return "";
  return "'" + text + "' is not a whole number of at most 64 bits";
}

std::string checkNamed(const std::string& text) { return text.empty() ? "a name is needed" : ""; }

void checkOutput(const std::filesystem::path& path, const std::string& extension) {
  if (path.extension() != extension)
    throwInput("{}: the name of this output must end in {}", path.string(), extension);
  checkWritable(path);
}

}  // namespace probelab
