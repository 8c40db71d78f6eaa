// SPDX-License-Identifier: Apache-2.0
// Texel values for which the bilinear reading of an octahedral map is right.
#pragma once

#include <Eigen/Core>

namespace probelab {

// Matrix [n^2][n^2] that turns samples of a smooth function at the texels' directions into texel
// values whose bilinear reading (shared/octahedral.h) is nearest to the function in the
// least-squares sense over the sphere. Samples are expanded in spherical harmonics as far as n^2
// texels carry them; what the expansion does not hold passes through unchanged. Rows sum to 1.
Eigen::MatrixXd bilinearFit(int n);

}  // namespace probelab
