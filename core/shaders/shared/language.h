// SPDX-License-Identifier: Apache-2.0
// What lets one header compile as C++ and as GLSL. In C++ every shared function is a template on the
// scalar T (float, double or an automatic-differentiation type); in GLSL the scalar is float.
//
// Rules for shared headers: GLSL spelling, no swizzles, constructors spelt REAL/VEC2/VEC3/VEC4,
// literals as REAL(0.5), indices taken from the value part with floorToInt.
#ifndef PROBELAB_SHARED_LANGUAGE_H
#define PROBELAB_SHARED_LANGUAGE_H

#ifdef __cplusplus

#include <bit>
#include <cmath>
#include <cstdint>

#include "base/vec.h"

#define PL_FUNCTION template <class T> inline
#define PL_INLINE inline  // a function on plain float
#define PL_STRUCT template <class T> struct
#define PL_OF_T <T>      // names an instance of a shared struct: QueryParams PL_OF_T params
#define PL_INOUT(type) type&
#define PL_CONST_IN(type) const type&
#define REAL T
#define VEC2 Vec2<T>
#define VEC3 Vec3<T>
#define VEC4 Vec4<T>

namespace probelab {

using std::abs;
using std::floor;
using std::pow;
using std::sqrt;
using uint = std::uint32_t;

template <class T>
constexpr T max(const T& a, const T& b) { return a < b ? b : a; }
template <class T>
constexpr T min(const T& a, const T& b) { return b < a ? b : a; }
template <class T>
constexpr T clamp(const T& x, const T& low, const T& high) { return min(max(x, low), high); }
template <class T>
Vec3<T> pow(const Vec3<T>& v, const Vec3<T>& e) {
  return {pow(v.x, e.x), pow(v.y, e.y), pow(v.z, e.z)};
}
template <class T>
Vec3<T> sqrt(const Vec3<T>& v) { return {sqrt(v.x), sqrt(v.y), sqrt(v.z)}; }

inline int floorToInt(float x) { return static_cast<int>(std::floor(x)); }
inline int floorToInt(double x) { return static_cast<int>(std::floor(x)); }
template <class Jet>
auto floorToInt(const Jet& x) -> decltype(x.a, 0) { return floorToInt(x.a); }

// x^e for x >= 0. `halves` is 2 e where that is a whole number and -1 elsewhere: GLSL is specialised
// to it, because a software device pays for a pow even where a branch avoids it. C++ takes e, so
// that an automatic-differentiation type keeps its derivative by the exponent.
template <class T>
T powParameter(const T& x, const T& e, int /*halves*/) { return pow(x, e); }
template <class T>
Vec3<T> powParameter(const Vec3<T>& x, const T& e, int /*halves*/) { return pow(x, Vec3<T>(e)); }

inline uint floatBitsToUint(float x) { return std::bit_cast<uint>(x); }
inline float uintBitsToFloat(uint x) { return std::bit_cast<float>(x); }

}  // namespace probelab

#define PL_NAMESPACE_BEGIN namespace probelab {
#define PL_NAMESPACE_END }

#else

#define PL_FUNCTION
#define PL_INLINE
#define PL_STRUCT struct
#define PL_OF_T
#define PL_INOUT(type) inout type
#define PL_CONST_IN(type) const type
#define REAL float
#define VEC2 vec2
#define VEC3 vec3
#define VEC4 vec4
#define PL_NAMESPACE_BEGIN
#define PL_NAMESPACE_END

int floorToInt(float x) { return int(floor(x)); }

// `halves` is a literal; up to 15.
vec3 powParameter(vec3 x, float e, const int halves) {
  if (halves < 0) return pow(x, vec3(e));
  vec3 result = vec3(1.0);
  if ((halves & 1) != 0) result = sqrt(x);
  if ((halves & 2) != 0) result *= x;
  vec3 square = x * x;
  if ((halves & 4) != 0) result *= square;
  if ((halves & 8) != 0) result *= square * square;
  return result;
}
float powParameter(float x, float e, const int halves) {
  return powParameter(vec3(x), e, halves).x;
}

#endif

#endif
