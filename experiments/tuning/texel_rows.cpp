// SPDX-License-Identifier: GPL-3.0-or-later
#include "texel_rows.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "field_view.h"

namespace probelab {
namespace {

// A number with its slopes by texels, as a sum: a texel may be there several times. Numbers that
// come from geometry have none, so a query costs little more than one in double.
struct TexelDual {
  double a = 0;  // value; the name that floorToInt knows
  std::vector<TexelSlope> slopes;

  TexelDual() = default;
  template <class Number>
  requires std::is_arithmetic_v<Number>
  explicit TexelDual(Number value) : a(static_cast<double>(value)) {}
};

TexelDual scaled(const TexelDual& x, double value, double factor) {
  TexelDual result(value);
  result.slopes = x.slopes;
  for (TexelSlope& s : result.slopes) s.slope *= factor;
  return result;
}

// value with the slopes x * factor_x + y * factor_y.
TexelDual combined(double value, const TexelDual& x, double factor_x, const TexelDual& y,
                   double factor_y) {
  TexelDual result(value);
  if (x.slopes.empty() && y.slopes.empty()) return result;
  result.slopes.reserve(x.slopes.size() + y.slopes.size());
  for (const TexelSlope& s : x.slopes) result.slopes.push_back({s.texel, s.slope * factor_x});
  for (const TexelSlope& s : y.slopes) result.slopes.push_back({s.texel, s.slope * factor_y});
  return result;
}

TexelDual operator+(const TexelDual& x, const TexelDual& y) {
  return combined(x.a + y.a, x, 1, y, 1);
}
TexelDual operator-(const TexelDual& x, const TexelDual& y) {
  return combined(x.a - y.a, x, 1, y, -1);
}
TexelDual operator-(const TexelDual& x) { return scaled(x, -x.a, -1); }
TexelDual operator*(const TexelDual& x, const TexelDual& y) {
  return combined(x.a * y.a, x, y.a, y, x.a);
}
TexelDual operator/(const TexelDual& x, const TexelDual& y) {
  const double value = x.a / y.a;
  return combined(value, x, 1 / y.a, y, -value / y.a);
}
bool operator<(const TexelDual& x, const TexelDual& y) { return x.a < y.a; }
bool operator>(const TexelDual& x, const TexelDual& y) { return x.a > y.a; }
bool operator<=(const TexelDual& x, const TexelDual& y) { return x.a <= y.a; }
bool operator>=(const TexelDual& x, const TexelDual& y) { return x.a >= y.a; }
TexelDual abs(const TexelDual& x) { return x.a < 0 ? -x : x; }
TexelDual sqrt(const TexelDual& x) {
  const double value = std::sqrt(x.a);
  return scaled(x, value, x.a > 0 ? 0.5 / value : 0);
}
// No exponent of the query depends on a texel.
TexelDual pow(const TexelDual& x, const TexelDual& e) {
  const double value = std::pow(x.a, e.a);
  return scaled(x, value, x.a > 0 ? e.a * value / x.a : (e.a == 1 ? 1 : 0));
}

struct SlopeView : FieldView {
  std::span<const Vec3f> stored;
  const std::vector<int>& interior;

  Vec3<TexelDual> fetchIrradiance(int probe, int texel) const {
    const LatticeShape& lattice = field.lattice;
    const auto place = static_cast<std::size_t>(probe) * interior.size();
    const auto per_probe =
        static_cast<uint32_t>(lattice.irradiance_texels * lattice.irradiance_texels);
    const auto id = static_cast<uint32_t>(probe) * per_probe +
                    static_cast<uint32_t>(interior[static_cast<std::size_t>(texel)]);
    const Vec3f& value = stored[place + static_cast<std::size_t>(texel)];
    Vec3<TexelDual> result{TexelDual(value.x), TexelDual(value.y), TexelDual(value.z)};
    for (std::size_t c = 0; c < 3; ++c) result[c].slopes.push_back({id, 1});
    return result;
  }
};

// Each texel once, by number.
TexelRow rowOf(TexelDual&& answer) {
  std::vector<TexelSlope>& s = answer.slopes;
  std::stable_sort(s.begin(), s.end(),
                   [](const TexelSlope& x, const TexelSlope& y) { return x.texel < y.texel; });
  TexelRow row{answer.a, {}};
  for (const TexelSlope& slope : s) {
    if (row.slopes.empty() || row.slopes.back().texel != slope.texel)
      row.slopes.push_back({slope.texel, 0});
    row.slopes.back().slope += slope.slope;
  }
  return row;
}

}  // namespace

std::vector<int> interiorTexels(int texels, int border) {
  const int n = texels, side = n + 2 * border;
  std::vector<int> interior;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) interior.push_back(tileTexel(x - border, y - border, n, 0));
  return interior;
}

std::vector<std::array<TexelRow, 3>> texelRows(const FieldSnapshot& field,
                                               std::span<const Vec3f> stored, const Params& params,
                                               std::span<const QueryPoint> points) {
  const QueryModes modes = viewModes(field, params);
  const auto query = convertQueryParams<TexelDual>(queryParams(params));
  const std::vector<int> interior =
      interiorTexels(field.lattice.irradiance_texels, field.lattice.border);
  const SlopeView view{{field}, stored, interior};
  std::vector<std::array<TexelRow, 3>> rows(points.size());
  parallelFor(points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      QueryResult<TexelDual> answer = queryView(view, query, modes, points[i]);
      for (std::size_t c = 0; c < 3; ++c) rows[i][c] = rowOf(std::move(answer.irradiance[c]));
    }
  });
  return rows;
}

}  // namespace probelab
