// SPDX-License-Identifier: GPL-3.0-or-later
// A study, beside a scene that it may name, expanded to its cells.
#include "fuzz.h"
#include "study.h"

void probelab::fuzz::runStudyToml(Bytes bytes) {
  const std::filesystem::path path = inputFile(bytes, "study.toml");
  for (const char* size : {"", "smoke"})
    expectLoadedOrRefused([&] { loadStudy(path, {.size = size}); });
}
