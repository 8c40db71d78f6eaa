// SPDX-License-Identifier: GPL-3.0-or-later
// What `bench` times beside the field, in turns with its updates: the bare Embree loop over the
// same rays, and the textbook's blending and query with its own texel counts.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ddgi/probe_field.h"
#include "ddgi/textbook.h"
#include "field_setup.h"
#include "json.h"
#include "trace/bare_loop.h"

namespace probelab {

// [update] each.
struct BaselineTimes {
  std::vector<double> bare_ms;
  std::vector<double> textbook_irradiance_ms, textbook_moments_ms;
  std::vector<double> textbook_query_ns, query_ns;  // a point
  std::vector<double> textbook_blend_ms() const;    // both atlases
};

class Baselines {
 public:
  // The textbook stores every point of the field's lattice; points without a probe get another
  // probe's rays, so that all do the same work. Without a textbook (`why_not`) when the lattice is
  // larger than the device's images.
  Baselines(FieldSetup& setup, std::vector<QueryPoint> points);

  // Once after update number `update` of the field.
  void measure(uint64_t update);

  const BaselineTimes& times() const { return times_; }
  // Probes of the textbook over those of the field: its blending is compared a probe.
  double probeRatio() const;
  // {irradiance_texels, moment_texels, probes, rays}, or null.
  Json textbookJson() const;
  const std::string& whyNoTextbook() const { return why_not_; }

 private:
  void makeTextbook();

  FieldSetup& setup_;
  std::vector<QueryPoint> points_;
  BareLoop bare_;
  std::optional<TextbookField> textbook_;
  std::string why_not_;
  BaselineTimes times_;
};

}  // namespace probelab
