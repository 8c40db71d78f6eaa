// SPDX-License-Identifier: GPL-3.0-or-later
// The options that every command has, and checks that several of them share.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace probelab {

struct CommonOptions {
  bool json = false;   // one JSON object on stdout
  bool quiet = false;  // no progress, no notes on stderr
  uint64_t seed = 1;
  std::string device;  // index or part of a name; empty: the best one
  int threads = 0;     // 0: all of the machine's
  std::string cache = "results/runs/cache";
  bool validation = false;
  std::vector<std::string> require;  // conditions on the JSON, require.h
};

// `validation` is also set by the environment variable PROBELAB_VALIDATION (anything but "" and
// "0").
void addCommonOptions(CLI::App& app, CommonOptions& options);

// SCENE, the first argument of most commands.
void addSceneArgument(CLI::App& app, std::string& scene);
// -o FILE; `type` is how the help names the file ("REF.exr").
void addOutputOption(CLI::App& app, std::string& output, const std::string& type,
                     const std::string& description, bool required);

// Checks for CLI::Option::check: an empty string, or what is wrong with the value.
std::string checkPositive(const std::string& text);         // a finite number above 0
std::string checkNotNegative(const std::string& text);      // a finite number from 0 on
std::string checkPositiveInteger(const std::string& text);  // 1 ... 2^31 - 1
std::string checkFinite(const std::string& text);
std::string checkSeed(const std::string& text);   // 0 ... 2^64 - 1
std::string checkNamed(const std::string& text);  // not empty

// Throws InputError unless the path ends in `extension` (".exr") and can be created.
void checkOutput(const std::filesystem::path& path, const std::string& extension);

}  // namespace probelab
