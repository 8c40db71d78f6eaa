// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer's entry for the one format that PROBELAB_FUZZ_RUN names.
#include <cstddef>

#include "fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  probelab::fuzz::PROBELAB_FUZZ_RUN({data, size});
  return 0;
}
