// SPDX-License-Identifier: GPL-3.0-or-later
#include "stability/limits.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace probelab {
namespace {

constexpr double kTolerance = 0.2;

}  // namespace

RecordedLimits recordedLimits(const std::string& device) {
  RecordedLimits limits;
  for (const EmbeddedFile& file : limitFiles())
    if (device.starts_with(file.name))
      limits = nlohmann::json::parse(file.text).get<RecordedLimits>();
  return limits;
}

Measurement againstRecord(const Measurement& measured, const std::string& id,
                          const RecordedLimits& recorded) {
  if (measured.verdict != Verdict::limit || recorded.empty()) return measured;
  Measurement judged = measured;
  const auto known = recorded.find(id);
  if (known == recorded.end()) {
    judged.verdict = Verdict::fails;
    judged.text += "; no limit is recorded";
    return judged;
  }
  const double point = measured.breaking_point.value_or(NAN);
  if (std::abs(point - known->second) <= kTolerance * known->second) return judged;
  judged.verdict = Verdict::fails;
  judged.text += fmt::format("; {:.3g}, recorded {:.3g} within 20 %", point, known->second);
  return judged;
}

}  // namespace probelab
