// SPDX-License-Identifier: GPL-3.0-or-later
// A file of --params, and its text as the value of --set.
#include <algorithm>

#include "ddgi/params.h"
#include "fuzz.h"

void probelab::fuzz::runParamsToml(Bytes bytes) {
  const std::filesystem::path path = inputFile(bytes, "input.toml");
  expectLoadedOrRefused([&] { validateParams(loadParams(path.string())); });
  static const Params kStart = loadParams("probelab");
  const std::string line(bytes.begin(), std::find(bytes.begin(), bytes.end(), '\n'));
  expectLoadedOrRefused([&] {
    Params params = kStart;
    setParam(params, line);
    validateParams(params);
  });
}
