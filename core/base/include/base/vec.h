// SPDX-License-Identifier: Apache-2.0
// Small vectors and a 4x4 matrix. Templated on the scalar, so that the shader headers in
// core/shaders/shared run on float, double and automatic-differentiation types alike. The names of
// the functions are GLSL's.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace probelab {

template <class T>
struct Vec2 {
  T x{}, y{};
  constexpr Vec2() = default;
  constexpr explicit Vec2(T s) : x(s), y(s) {}
  constexpr Vec2(T x_, T y_) : x(x_), y(y_) {}
  template <class U>
  constexpr explicit Vec2(const Vec2<U>& v) : x(T(v.x)), y(T(v.y)) {}
  constexpr T& operator[](std::size_t i) { return i == 0 ? x : y; }
  constexpr const T& operator[](std::size_t i) const { return i == 0 ? x : y; }
  constexpr bool operator==(const Vec2&) const = default;
};

template <class T>
struct Vec3 {
  T x{}, y{}, z{};
  constexpr Vec3() = default;
  constexpr explicit Vec3(T s) : x(s), y(s), z(s) {}
  constexpr Vec3(T x_, T y_, T z_) : x(x_), y(y_), z(z_) {}
  template <class U>
  constexpr explicit Vec3(const Vec3<U>& v) : x(T(v.x)), y(T(v.y)), z(T(v.z)) {}
  constexpr T& operator[](std::size_t i) { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr const T& operator[](std::size_t i) const { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr bool operator==(const Vec3&) const = default;
};

template <class T>
struct Vec4 {
  T x{}, y{}, z{}, w{};
  constexpr Vec4() = default;
  constexpr explicit Vec4(T s) : x(s), y(s), z(s), w(s) {}
  constexpr Vec4(T x_, T y_, T z_, T w_) : x(x_), y(y_), z(z_), w(w_) {}
  template <class U>
  constexpr explicit Vec4(const Vec4<U>& v) : x(T(v.x)), y(T(v.y)), z(T(v.z)), w(T(v.w)) {}
  constexpr bool operator==(const Vec4&) const = default;
};

#define PROBELAB_VEC_OPERATOR(op)                                                                  \
  template <class T>                                                                               \
  constexpr Vec2<T> operator op(const Vec2<T>& a, const Vec2<T>& b) {                              \
    return {a.x op b.x, a.y op b.y};                                                               \
  }                                                                                                \
  template <class T>                                                                               \
  constexpr Vec3<T> operator op(const Vec3<T>& a, const Vec3<T>& b) {                              \
    return {a.x op b.x, a.y op b.y, a.z op b.z};                                                   \
  }                                                                                                \
  template <class T>                                                                               \
  constexpr Vec4<T> operator op(const Vec4<T>& a, const Vec4<T>& b) {                              \
    return {a.x op b.x, a.y op b.y, a.z op b.z, a.w op b.w};                                       \
  }                                                                                                \
  template <class T>                                                                               \
  constexpr Vec2<T> operator op(const Vec2<T>& a, const T& s) {                                    \
    return {a.x op s, a.y op s};                                                                   \
  }                                                                                                \
  template <class T>                                                                               \
  constexpr Vec3<T> operator op(const Vec3<T>& a, const T& s) {                                    \
    return {a.x op s, a.y op s, a.z op s};                                                         \
  }                                                                                                \
  template <class T>                                                                               \
  constexpr Vec4<T> operator op(const Vec4<T>& a, const T& s) {                                    \
    return {a.x op s, a.y op s, a.z op s, a.w op s};                                               \
  }
PROBELAB_VEC_OPERATOR(+)
PROBELAB_VEC_OPERATOR(-)
PROBELAB_VEC_OPERATOR(*)
PROBELAB_VEC_OPERATOR(/)
#undef PROBELAB_VEC_OPERATOR

template <class T>
constexpr Vec2<T> operator*(const T& s, const Vec2<T>& a) { return a * s; }
template <class T>
constexpr Vec3<T> operator*(const T& s, const Vec3<T>& a) { return a * s; }
template <class T>
constexpr Vec3<T> operator-(const Vec3<T>& a) { return {-a.x, -a.y, -a.z}; }
template <class T>
constexpr Vec2<T>& operator+=(Vec2<T>& a, const Vec2<T>& b) { return a = a + b; }
template <class T>
constexpr Vec3<T>& operator+=(Vec3<T>& a, const Vec3<T>& b) { return a = a + b; }
template <class T>
constexpr Vec3<T>& operator-=(Vec3<T>& a, const Vec3<T>& b) { return a = a - b; }
template <class T>
constexpr Vec3<T>& operator*=(Vec3<T>& a, const Vec3<T>& b) { return a = a * b; }
template <class T>
constexpr Vec3<T>& operator*=(Vec3<T>& a, const T& s) { return a = a * s; }
template <class T>
constexpr Vec3<T>& operator/=(Vec3<T>& a, const T& s) { return a = a / s; }

template <class T>
constexpr T dot(const Vec2<T>& a, const Vec2<T>& b) { return a.x * b.x + a.y * b.y; }
template <class T>
constexpr T dot(const Vec3<T>& a, const Vec3<T>& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class T>
constexpr T dot(const Vec4<T>& a, const Vec4<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}
template <class T>
constexpr Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T length(const Vec3<T>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}
// Undefined for a zero vector, as in GLSL: the caller guards.
template <class T>
Vec3<T> normalize(const Vec3<T>& a) { return a / length(a); }

template <class T>
constexpr Vec3<T> componentMin(const Vec3<T>& a, const Vec3<T>& b) {
  return {b.x < a.x ? b.x : a.x, b.y < a.y ? b.y : a.y, b.z < a.z ? b.z : a.z};
}
template <class T>
constexpr Vec3<T> componentMax(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x < b.x ? b.x : a.x, a.y < b.y ? b.y : a.y, a.z < b.z ? b.z : a.z};
}
template <class T>
constexpr T maxComponent(const Vec3<T>& a) {
  const T m = a.x < a.y ? a.y : a.x;
  return m < a.z ? a.z : m;
}
template <class T>
constexpr T minComponent(const Vec3<T>& a) {
  const T m = a.y < a.x ? a.y : a.x;
  return a.z < m ? a.z : m;
}

using Vec2f = Vec2<float>;
using Vec3f = Vec3<float>;
using Vec4f = Vec4<float>;
using Vec2d = Vec2<double>;
using Vec3d = Vec3<double>;
using Vec3i = Vec3<int>;

inline bool isFinite(const Vec3f& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
inline bool isFinite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Luminance of linear Rec.709 RGB.
template <class T>
constexpr T luminance(const Vec3<T>& c) {
  return T(0.2126) * c.x + T(0.7152) * c.y + T(0.0722) * c.z;
}

// Axis-aligned box; empty (min > max) until extended.
template <class T>
struct Box {
  Vec3<T> min{std::numeric_limits<T>::max()};
  Vec3<T> max{std::numeric_limits<T>::lowest()};
  bool empty() const { return min.x > max.x || min.y > max.y || min.z > max.z; }
  Vec3<T> extent() const { return max - min; }
  Vec3<T> center() const { return (min + max) * T(0.5); }
  T diagonal() const { return length(max - min); }
  bool contains(const Vec3<T>& p) const {
    return p.x >= min.x && p.y >= min.y && p.z >= min.z && p.x <= max.x && p.y <= max.y &&
           p.z <= max.z;
  }
  void extend(const Vec3<T>& p) { min = componentMin(min, p), max = componentMax(max, p); }
};
using Box3f = Box<float>;
using Box3d = Box<double>;

// Row-major 4x4 transform in double; column vectors, so (A * B) applies B first.
struct Mat4d {
  double m[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
};
inline Mat4d operator*(const Mat4d& a, const Mat4d& b) {
  Mat4d r;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      r.m[i][j] = 0;
      for (int k = 0; k < 4; ++k) r.m[i][j] += a.m[i][k] * b.m[k][j];
    }
  return r;
}
inline Vec3d transformPoint(const Mat4d& a, const Vec3d& p) {
  return {a.m[0][0] * p.x + a.m[0][1] * p.y + a.m[0][2] * p.z + a.m[0][3],
          a.m[1][0] * p.x + a.m[1][1] * p.y + a.m[1][2] * p.z + a.m[1][3],
          a.m[2][0] * p.x + a.m[2][1] * p.y + a.m[2][2] * p.z + a.m[2][3]};
}
inline Vec3d transformVector(const Mat4d& a, const Vec3d& v) {
  return {a.m[0][0] * v.x + a.m[0][1] * v.y + a.m[0][2] * v.z,
          a.m[1][0] * v.x + a.m[1][1] * v.y + a.m[1][2] * v.z,
          a.m[2][0] * v.x + a.m[2][1] * v.y + a.m[2][2] * v.z};
}

}  // namespace probelab
