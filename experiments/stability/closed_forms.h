// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers that the cases are held to.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/vec.h"

namespace probelab {

// Irradiance at a point with unit normal from a polygon of radiance 1 above its horizon, corners
// in either order: |sum of theta_i (gamma_i . n)| / 2 (Lambert 1760).
double polygonIrradiance(std::span<const Vec3d> corners, const Vec3d& point, const Vec3d& normal);

// Irradiance at a point for each of the unit normals, of what comes from direction w (unit):
// midpoints of 512 x 1024 equal solid angles.
std::vector<double> irradianceOf(std::span<const Vec3d> normals,
                                 const std::function<double(const Vec3d&)>& radiance);

// The spacing of a format's numbers around `value`: "rgba16f", ...; `channel` 2 is blue.
double formatUlp(const std::string& format, std::size_t channel, double value);

// The largest and the smallest number that the format holds with its full relative precision.
double formatLargest(const std::string& format);
double formatSmallestNormal(const std::string& format);

}  // namespace probelab
