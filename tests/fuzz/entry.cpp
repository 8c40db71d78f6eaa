// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer's entry for the one format that PROBELAB_FUZZ_RUN names.
#include <cstddef>

#include "fuzz.h"

// What is set up once (scenes, reachable space) does not count as the time of an input.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  probelab::fuzz::PROBELAB_FUZZ_RUN({});
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  probelab::fuzz::PROBELAB_FUZZ_RUN({data, size});
  return 0;
}
