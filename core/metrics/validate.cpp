// SPDX-License-Identifier: Apache-2.0
#include "validate.h"

#include "base/error.h"

namespace probelab {

void requireFinite(std::span<const Vec3f> values, const char* name) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!isFinite(values[i]))
      throw NumericalError(fmt::format("metrics: {}[{}] is not finite: {}, {}, {}", name, i,
                                       values[i].x, values[i].y, values[i].z));
}

void validateSamples(const ReceiverSamples& s) {
  const std::size_t n = s.estimate.size();
  PROBELAB_CHECK_EQ(s.a.size(), n);
  PROBELAB_CHECK_EQ(s.b.size(), n);
  PROBELAB_CHECK_EQ(s.position.size(), n);
  PROBELAB_CHECK_EQ(s.area.size(), n);
  PROBELAB_CHECK(s.region.empty() || s.region.size() == n);
  PROBELAB_CHECK(s.kind.empty() || s.kind.size() == n);
  if (n == 0) throwInput("metrics: there are no receivers; ask for at least one");
  requireFinite(s.estimate, "estimate");
  requireFinite(s.a, "reference a");
  requireFinite(s.b, "reference b");
  requireFinite(s.position, "position");
  double total = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!std::isfinite(s.area[i]))
      throw NumericalError(fmt::format("metrics: area[{}] is not finite: {}", i, s.area[i]));
    if (s.area[i] < 0) throwInput("metrics: area[{}] is negative: {}", i, s.area[i]);
    total += s.area[i];
  }
  if (!(total > 0)) throwInput("metrics: the receivers' areas sum to 0; give them weights");
}

}  // namespace probelab
