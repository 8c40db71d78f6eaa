// SPDX-License-Identifier: Apache-2.0
// Ray origins that lie safely on their own side of the surface they leave: the hit point comes from
// barycentrics, its rounding error is bounded, and the origin moves along the geometric normal by
// just that bound (Pharr, Jakob, Humphreys, Physically Based Rendering, 4th edition, 6.8). Plain
// float; included by core/trace and by the shade stage.
//
// The offset is a few 1e-7 of the coordinates and of the triangle's size (1 mm at 1 km from the
// origin, 10 um in a room); walls and gaps stay what they are while they are wider than that.
#ifndef PROBELAB_SHARED_OFFSET_H
#define PROBELAB_SHARED_OFFSET_H

#include "shared/ray.h"

PL_NAMESPACE_BEGIN

// n rounding errors of fp32 in a row: n u / (1 - n u), u = 2^-24.
PL_INLINE float roundingBound(float n) {
  const float n_u = n * 5.9604645e-8f;
  return n_u / (1.0f - n_u);
}

PL_INLINE PL_FLOAT3 absolute(PL_FLOAT3 v) { return PL_FLOAT3(abs(v.x), abs(v.y), abs(v.z)); }

// A point and the bound of its error on each axis, in metres.
struct BoundedPoint {
  PL_FLOAT3 position;
  PL_FLOAT3 error;
};

// How far the plane of a triangle may seem displaced to an intersection test in fp32 that starts on
// it: the test works on vertices relative to the origin, so it errs in proportion to the triangle's
// size, and its normal errs by the rounding over the height of a sliver (longest edge over height,
// up to 1,000: beyond, a sliver may shadow itself rather than throw its rays through a wall).
// Without this a point on the plane x = 0 would not move at all, and be hit again at t = 0.
PL_INLINE float planeError(PL_FLOAT3 p0, PL_FLOAT3 p1, PL_FLOAT3 p2) {
  const PL_FLOAT3 a = p1 - p0;
  const PL_FLOAT3 b = p2 - p0;
  const PL_FLOAT3 c = p2 - p1;
  const float longest_sq = max(dot(a, a), max(dot(b, b), dot(c, c)));
  const float aspect = longest_sq / max(length(cross(a, b)), 1e-3f * longest_sq + 1e-37f);
  return roundingBound(3.0f) * sqrt(longest_sq) * max(aspect, 1.0f);
}

// The point u, v of a triangle (weights of the second and third vertex, as in Hit).
PL_INLINE BoundedPoint pointOnTriangle(PL_FLOAT3 p0, PL_FLOAT3 p1, PL_FLOAT3 p2, float u, float v) {
  const PL_FLOAT3 a = p0 * (1.0f - u - v);
  const PL_FLOAT3 b = p1 * u;
  const PL_FLOAT3 c = p2 * v;
  BoundedPoint result;
  result.position = a + b + c;
  result.error = (absolute(a) + absolute(b) + absolute(c)) * roundingBound(7.0f) +
                 PL_FLOAT3(planeError(p0, p1, p2));
  return result;
}

// The same for a point that is given without its triangle (receivers): `extent` is the largest
// absolute coordinate of the scene's box and stands for the size of what the point may lie on.
PL_INLINE BoundedPoint pointWithoutTriangle(PL_FLOAT3 p, float extent) {
  BoundedPoint result;
  result.position = p;
  result.error = absolute(p) * roundingBound(7.0f) + PL_FLOAT3(extent * roundingBound(16.0f));
  return result;
}

// The next float away from zero in the sense of `push`: up where push > 0, down where push < 0.
PL_INLINE float nextFloatToward(float x, float push) {
  if (push == 0.0f) return x;
  if (x == 0.0f) return push > 0.0f ? 1.1754944e-38f : -1.1754944e-38f;
  const PL_UINT bits = floatBitsToUint(x);
  return uintBitsToFloat((x > 0.0f) == (push > 0.0f) ? bits + 1u : bits - 1u);
}

// Origin of a ray in `direction` that leaves the surface with geometric normal `normal` (unit).
PL_INLINE PL_FLOAT3 offsetOrigin(PL_CONST_IN(BoundedPoint) point, PL_FLOAT3 normal,
                                 PL_FLOAT3 direction) {
  const float distance_m = dot(absolute(normal), point.error);
  const float side = dot(direction, normal) < 0.0f ? -distance_m : distance_m;
  const PL_FLOAT3 push = normal * side;
  const PL_FLOAT3 moved = point.position + push;
  return PL_FLOAT3(nextFloatToward(moved.x, push.x), nextFloatToward(moved.y, push.y),
                   nextFloatToward(moved.z, push.z));
}

PL_NAMESPACE_END

#endif
