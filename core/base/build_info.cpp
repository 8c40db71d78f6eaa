// SPDX-License-Identifier: Apache-2.0
#include "base/build_info.h"

#include "version.h"  // written by core/cmake/WriteVersion.cmake

namespace probelab {

BuildInfo buildInfo() {
  return {PROBELAB_VERSION, PROBELAB_COMPILER, PROBELAB_BUILD_TYPE};
}

}  // namespace probelab
