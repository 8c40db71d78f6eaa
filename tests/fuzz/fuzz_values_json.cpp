// SPDX-License-Identifier: GPL-3.0-or-later
// Fitted values of texels.
#include "fuzz.h"
#include "tuning/values_file.h"

void probelab::fuzz::runValuesJson(Bytes bytes) {
  expectLoadedOrRefused([&] { readValues(inputFile(bytes, "input.json")); });
}
