// SPDX-License-Identifier: GPL-3.0-or-later
// For static lighting: irradiance texels such that the query itself comes out right at the train
// receivers, held towards the traced values.
//
// Per channel, x = stored texels, t = traced ones, d = (x - t) / (t + floor * mean of t) * gamma, the
// relative deviation of a texel's irradiance:
//   minimise  sum_i w_i (E_i(x) - R_i)^2 / power + (pull * sum_t d_t^2 + smoothness * sum over
//             neighbouring texels of a probe (d_t - d_u)^2) * sum_i w_i^2
// with w the receivers' areas (sum 1) and power = sum_i w_i A_i B_i, so that the first term is
// nrmse^2. E is linear in the texels with average = "linear" and encoding_gamma = 1; otherwise it is
// made linear again and again (Gauss-Newton).
#pragma once

#include <vector>

#include "ddgi/snapshot.h"
#include "trace/receivers.h"

namespace probelab {

struct ValueFitSettings {
  // Towards the traced values: the square of the error that no texel can mend over the square of
  // the deviations to expect. It does not depend on how many receivers or texels there are.
  double pull = 0.1;
  double smoothness = 0;   // of deviations over a probe's texels, in the same units
  double floor = 0.1;      // share of the mean texel that a dark texel may move by
  int iterations = 200;    // of conjugate gradients, a round
  bool extend = false;
};

struct ValueFit {
  std::vector<Vec3f> irradiance;  // texels as FieldSnapshot::irradiance
  int linearisations = 0;
  int iterations = 0;        // of conjugate gradients, of the channel that took most
  std::size_t texels = 0;    // that the receivers read, interior ones
  double train_before = 0, train_after = 0;  // nrmse at the receivers, luminance
};

// The receivers of `split` are fitted. Texels stay non-negative; those that no receiver reads keep
// their value. Throws InputError where no receiver is of the split or none of them gets light, or
// where `params` ask for what the field has not.
ValueFit fitValues(const FieldSnapshot& field, const Receivers& receivers, Split split,
                   const Params& params, const ValueFitSettings& settings);

// Another light's texels with the gain that the fit gave each of them: other * fitted / traced,
// unchanged where traced is 0.
std::vector<Vec3f> transferGains(const std::vector<Vec3f>& traced, const std::vector<Vec3f>& fitted,
                                 const std::vector<Vec3f>& other);

}  // namespace probelab
