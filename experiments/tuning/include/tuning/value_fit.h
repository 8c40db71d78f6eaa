// SPDX-License-Identifier: GPL-3.0-or-later
// For static lighting: irradiance texels such that the query itself comes out right at the train
// receivers, held towards the traced values.
//
// Per channel, over the stored texels x of all probes that a receiver reads:
//   minimise  sum_i w_i (E_i(x) - R_i)^2 / power
//             + sum_i w_i^2 * (pull * sum_t d_t^2 + smoothness * sum over neighbours (d_t - d_u)^2)
// w are the receivers' areas (sum 1), power = sum_i w_i A_i B_i, so that the first term is nrmse^2
// up to the reference's noise; d_t = (x_t - traced_t) / (traced_t + floor * mean traced) * gamma is
// the relative deviation of a texel's irradiance, and neighbours are texels side by side in a
// probe's map, seams included: a texel that no receiver reads follows those beside it. E is linear
// in the texels with average = "linear" and encoding_gamma = 1; otherwise it is made linear again
// and again (Gauss-Newton).
#pragma once

#include <span>
#include <vector>

#include "ddgi/snapshot.h"
#include "trace/receivers.h"

namespace probelab {

// The defaults were chosen on held-out receivers of two_rooms_door, sun_room, pillar_hall and
// corridor_l (256 probes, 4,096 receivers), where none got worse. A weaker pull removes more where
// irradiance is smooth, and fits shafts of light that no texel can follow: from 0.3 down sun_room is
// worse than as traced.
struct ValueFitSettings {
  // Towards the traced values: the square of the error that no texel can mend, as nrmse, over the
  // square of the deviations to expect. It does not depend on how many receivers or texels there
  // are.
  double pull = 1;
  double smoothness = 10;  // in the same units
  double floor = 0.1;
  int iterations = 500;  // of conjugate gradients, for one set of texels held at 0
};

struct ValueFit {
  std::vector<Vec3f> irradiance;             // texels as FieldSnapshot::irradiance
  std::size_t texels = 0;                    // interior ones that were free to move
  int linearisations = 0;                    // 1 where the query is linear in the texels
  int iterations = 0;                        // of conjugate gradients, of the slowest channel
  double train_before = 0, train_after = 0;  // nrmse at the receivers fitted to, luminance
};

// Fits to the receivers of `split` under the query parameters `params`, which must go with the
// field's texels. Texels stay non-negative (above 1 % of the traced value where E is not linear in
// them); those of probes that no receiver reads keep their value, and so do texels without light
// (below 1e-6 of the mean, where no gain is known) and a channel without any. Parallel and
// deterministic. Throws InputError where no receiver is of the split or none of them gets light,
// where `params` ask for what the field has not, and on settings out of range.
ValueFit fitValues(const FieldSnapshot& field, const Receivers& receivers, Split split,
                   const Params& params, const ValueFitSettings& settings);

// Another light's texels with the gain that the fit gave each of them: other * fitted / traced,
// unchanged where traced is 0.
std::vector<Vec3f> transferGains(const std::vector<Vec3f>& traced, const std::vector<Vec3f>& fitted,
                                 const std::vector<Vec3f>& other);

}  // namespace probelab
