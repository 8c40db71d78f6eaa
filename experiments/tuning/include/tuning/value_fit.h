// SPDX-License-Identifier: GPL-3.0-or-later
// For static lighting: irradiance texels such that the query itself comes out right. With linear
// averaging and gamma 1 the query is linear in the texels, so this is a sparse least-squares problem,
// held towards the traced values.
#pragma once

#include "tuning/frozen_state.h"

namespace probelab {

struct ValueFitSettings {
  double pull = 0.1;     // towards the traced values: weight of a texel's relative deviation
  int iterations = 200;  // of conjugate gradients
};

struct ValueFit {
  std::vector<Vec3f> irradiance;  // texels as FieldSnapshot::irradiance
  int iterations = 0;
  double train_before = 0, train_after = 0;  // nrmse at the points
};

// `points` are the receivers themselves (RGB truth is needed). Texels stay non-negative; those that no
// receiver reads keep their value. Throws InputError where the query is not linear in the texels,
// naming the key to change.
ValueFit fitValues(const FieldSnapshot& field, const Receivers& receivers, Split split,
                   const Params& params, const ValueFitSettings& settings);

// Another light's texels with the gain that the fit gave each of them.
std::vector<Vec3f> transferGains(const std::vector<Vec3f>& traced, const std::vector<Vec3f>& fitted,
                                 const std::vector<Vec3f>& other);

}  // namespace probelab
