// SPDX-License-Identifier: Apache-2.0
#include "ddgi/layout_file.h"

#include "base/error.h"

namespace probelab {}  // namespace probelab
