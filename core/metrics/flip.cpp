// SPDX-License-Identifier: Apache-2.0
// Written from the two papers (metrics/flip.h); constants carry the papers' names. The filters are
// Gaussians or products of Gaussians and their derivatives, so they run as rows, then columns.
#include "metrics/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "validate.h"

namespace probelab {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kColorExponent = 0.7;          // q_c
constexpr double kColorCut = 0.4;               // p_c
constexpr double kColorCutValue = 0.95;         // p_t
constexpr double kFeatureExponent = 0.5;        // q_f
constexpr double kFeatureWidthDegrees = 0.082;  // w
constexpr double kMostStops = 64;               // either side of 1
constexpr double kAutomaticLevel = 0.85;        // of the tone curve, for automatic exposures

using Plane = std::vector<double>;  // [y][x]

struct Size {
  int width = 0, height = 0;
  std::size_t count() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

// Calls body(i) for every pixel.
void forEachPixel(std::size_t count, auto&& body) {
  parallelFor(count, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

// ---- colour spaces; (1, 1, 1) in linear Rec.709 is the white point everywhere.

constexpr double kRgbToXyz[3][3] = {
    {10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
    {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
    {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}};

Vec3d multiply(const double (&m)[3][3], const Vec3d& v) {
  return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z,
          m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
          m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
}

// XYZ over that of white.
Vec3d relativeXyz(const Vec3d& rgb) {
  const Vec3d xyz = multiply(kRgbToXyz, rgb), white = multiply(kRgbToXyz, Vec3d(1.0));
  return {xyz.x / white.x, xyz.y / white.y, xyz.z / white.z};
}

Vec3d rgbFromRelativeXyz(const Vec3d& relative) {
  const Vec3d white = multiply(kRgbToXyz, Vec3d(1.0));
  const Vec3d xyz(relative.x * white.x, relative.y * white.y, relative.z * white.z);
  // Cramer's rule on the rows of the matrix.
  const auto& m = kRgbToXyz;
  const Vec3d c0(m[0][0], m[1][0], m[2][0]), c1(m[0][1], m[1][1], m[2][1]),
      c2(m[0][2], m[1][2], m[2][2]);
  const double determinant = dot(c0, cross(c1, c2));
  return Vec3d(dot(xyz, cross(c1, c2)), dot(c0, cross(xyz, c2)), dot(c0, cross(c1, xyz))) /
         determinant;
}

// YCxCz, a linear opponent space.
Vec3d opponentFromRgb(const Vec3d& rgb) {
  const Vec3d w = relativeXyz(rgb);
  return {116 * w.y - 16, 500 * (w.x - w.y), 200 * (w.y - w.z)};
}

Vec3d rgbFromOpponent(const Vec3d& c) {
  const double y = (c.x + 16) / 116;
  return rgbFromRelativeXyz({c.y / 500 + y, y, y - c.z / 200});
}

// CIE L*a*b* with the Hunt effect: chroma scaled by lightness.
Vec3d huntLab(const Vec3d& rgb) {
  constexpr double delta = 6.0 / 29;
  const auto f = [](double t) {
    return t > delta * delta * delta ? std::cbrt(t) : t / (3 * delta * delta) + 4.0 / 29;
  };
  const Vec3d w = relativeXyz(rgb);
  const double lightness = 116 * f(w.y) - 16;
  return {lightness, 0.01 * lightness * 500 * (f(w.x) - f(w.y)),
          0.01 * lightness * 200 * (f(w.y) - f(w.z))};
}

double hyAb(const Vec3d& a, const Vec3d& b) {
  return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z);
}

// ---- filters, with the border's pixels repeated outwards

using Kernel = std::vector<double>;  // 2 radius + 1 weights

Plane convolveRows(const Plane& in, Size size, const Kernel& kernel) {
  const auto width = static_cast<std::size_t>(size.width);
  const std::size_t radius = kernel.size() / 2;
  Plane out(in.size(), 0.0);
  parallelFor(static_cast<std::size_t>(size.height), 8, [&](std::size_t begin, std::size_t end) {
    std::vector<double> padded(width + 2 * radius);
    for (std::size_t y = begin; y < end; ++y) {
      const double* line = in.data() + y * width;
      std::fill_n(padded.begin(), radius, line[0]);
      std::copy_n(line, width, padded.begin() + static_cast<std::ptrdiff_t>(radius));
      std::fill_n(padded.end() - static_cast<std::ptrdiff_t>(radius), radius, line[width - 1]);
      for (std::size_t k = 0; k < kernel.size(); ++k)
        for (std::size_t x = 0; x < width; ++x) out[y * width + x] += kernel[k] * padded[x + k];
    }
  });
  return out;
}

Plane convolveColumns(const Plane& in, Size size, const Kernel& kernel) {
  const int radius = static_cast<int>(kernel.size() / 2);
  const auto width = static_cast<std::size_t>(size.width);
  Plane out(in.size(), 0.0);
  parallelFor(static_cast<std::size_t>(size.height), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (int k = -radius; k <= radius; ++k) {
        const int source = std::clamp(static_cast<int>(y) + k, 0, size.height - 1);
        const double weight = kernel[k + radius];
        for (std::size_t x = 0; x < width; ++x)
          out[y * width + x] += weight * in[static_cast<std::size_t>(source) * width + x];
      }
  });
  return out;
}

Plane convolve(const Plane& in, Size size, const Kernel& rows, const Kernel& columns) {
  return convolveColumns(convolveRows(in, size, rows), size, columns);
}

Kernel makeKernel(int radius, auto&& weight) {
  Kernel kernel;
  for (int k = -radius; k <= radius; ++k) kernel.push_back(weight(double(k)));
  return kernel;
}

double sumOf(const Kernel& kernel) {
  double sum = 0;
  for (const double w : kernel) sum += w;
  return sum;
}

// ---- the colour pipeline

// One term a sqrt(pi / b) exp(-pi^2 x^2 / b) of a contrast sensitivity function, x in degrees.
struct Sensitivity {
  double a, b;
};

// Filters a channel by the sum of its terms, normalised to 1 over the window.
Plane filterSensitivity(const Plane& channel, Size size, std::span<const Sensitivity> terms,
                        double pixels_per_degree) {
  constexpr double largest_b = 0.04;  // of all channels: they share one window
  const int radius =
      static_cast<int>(std::ceil(3 * std::sqrt(largest_b / (2 * kPi * kPi)) * pixels_per_degree));
  Plane sum(channel.size(), 0.0);
  double total = 0;
  for (const auto& [a, b] : terms) {
    const Kernel kernel = makeKernel(radius, [&, b = b](double k) {
      const double x = k / pixels_per_degree;
      return std::exp(-kPi * kPi * x * x / b);
    });
    const double scale = a * std::sqrt(kPi / b);
    total += scale * sumOf(kernel) * sumOf(kernel);
    const Plane filtered = convolve(channel, size, kernel, kernel);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += scale * filtered[i];
  }
  for (double& v : sum) v /= total;
  return sum;
}

// What is left of an image at the viewing distance, in Hunt-adjusted L*a*b*.
std::vector<Vec3d> perceivedColors(const std::array<Plane, 3>& opponent, Size size,
                                   double pixels_per_degree) {
  constexpr Sensitivity kAchromatic[] = {{1, 0.0047}};
  constexpr Sensitivity kRedGreen[] = {{1, 0.0053}};
  constexpr Sensitivity kBlueYellow[] = {{34.1, 0.04}, {13.5, 0.025}};
  const Plane y = filterSensitivity(opponent[0], size, kAchromatic, pixels_per_degree);
  const Plane cx = filterSensitivity(opponent[1], size, kRedGreen, pixels_per_degree);
  const Plane cz = filterSensitivity(opponent[2], size, kBlueYellow, pixels_per_degree);
  std::vector<Vec3d> colors(size.count());
  for (std::size_t i = 0; i < colors.size(); ++i) {
    const Vec3d rgb = rgbFromOpponent({y[i], cx[i], cz[i]});
    colors[i] = huntLab(
        {std::clamp(rgb.x, 0.0, 1.0), std::clamp(rgb.y, 0.0, 1.0), std::clamp(rgb.z, 0.0, 1.0)});
  }
  return colors;
}

// Distances up to p_c of the largest fill [0, p_t], the others the rest.
double compressColorDistance(double distance, double largest) {
  const double d = std::pow(distance, kColorExponent);
  const double cut = kColorCut * largest;
  if (d < cut) return d * kColorCutValue / cut;
  return kColorCutValue + (d - cut) / (largest - cut) * (1 - kColorCutValue);
}

double largestColorDistance() {
  return std::pow(hyAb(huntLab({0, 1, 0}), huntLab({0, 0, 1})), kColorExponent);
}

// ---- the feature pipeline

struct Features {
  Plane edges, points;  // magnitudes
};

// Scales the positive weights to sum to 1 and the negative ones to -1.
Kernel balanced(Kernel kernel) {
  double positive = 0, negative = 0;
  for (const double w : kernel) (w > 0 ? positive : negative) += w;
  for (double& w : kernel) w /= w > 0 ? positive : -negative;
  return kernel;
}

Plane gradientMagnitude(const Plane& in, Size size, const Kernel& derivative,
                        const Kernel& smoothing) {
  const Plane x = convolve(in, size, derivative, smoothing);
  const Plane y = convolve(in, size, smoothing, derivative);
  Plane magnitude(in.size());
  forEachPixel(in.size(),
               [&](std::size_t i) { magnitude[i] = std::sqrt(x[i] * x[i] + y[i] * y[i]); });
  return magnitude;
}

Features detectFeatures(const Plane& opponent_y, Size size, double pixels_per_degree) {
  Plane grey(opponent_y);
  for (double& v : grey) v = (v + 16) / 116;
  const double sigma = 0.5 * kFeatureWidthDegrees * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  const auto gauss = [&](double k) { return std::exp(-k * k / (2 * sigma * sigma)); };
  Kernel smoothing = makeKernel(radius, gauss);
  const double total = sumOf(smoothing);
  for (double& w : smoothing) w /= total;
  const Kernel first = balanced(makeKernel(radius, [&](double k) { return -k * gauss(k); }));
  const Kernel second = balanced(
      makeKernel(radius, [&](double k) { return (k * k / (sigma * sigma) - 1) * gauss(k); }));
  return {gradientMagnitude(grey, size, first, smoothing),
          gradientMagnitude(grey, size, second, smoothing)};
}

double featureDifference(const Features& a, const Features& b, std::size_t i) {
  const double largest =
      std::max(std::abs(a.edges[i] - b.edges[i]), std::abs(a.points[i] - b.points[i]));
  return std::pow(largest / std::numbers::sqrt2, kFeatureExponent);
}

// ---- both together

std::array<Plane, 3> toOpponent(std::span<const Vec3d> rgb) {
  std::array<Plane, 3> planes = {Plane(rgb.size()), Plane(rgb.size()), Plane(rgb.size())};
  forEachPixel(rgb.size(), [&](std::size_t i) {
    const Vec3d c = opponentFromRgb(rgb[i]);
    planes[0][i] = c.x, planes[1][i] = c.y, planes[2][i] = c.z;
  });
  return planes;
}

// Of images in [0, 1].
Plane flipMap(std::span<const Vec3d> reference, std::span<const Vec3d> test, Size size,
              double pixels_per_degree) {
  const std::array<Plane, 3> r = toOpponent(reference), t = toOpponent(test);
  const std::vector<Vec3d> r_colors = perceivedColors(r, size, pixels_per_degree);
  const std::vector<Vec3d> t_colors = perceivedColors(t, size, pixels_per_degree);
  const Features r_features = detectFeatures(r[0], size, pixels_per_degree);
  const Features t_features = detectFeatures(t[0], size, pixels_per_degree);
  const double largest = largestColorDistance();
  Plane map(size.count());
  forEachPixel(map.size(), [&](std::size_t i) {
    const double color = compressColorDistance(hyAb(r_colors[i], t_colors[i]), largest);
    map[i] = std::pow(color, 1 - featureDifference(r_features, t_features, i));
  });
  return map;
}

FlipResult makeResult(const Plane& map) {
  FlipResult result;
  for (const double v : map) {
    result.mean += v;
    result.map.push_back(static_cast<float>(v));
  }
  result.mean /= static_cast<double>(map.size());
  return result;
}

Size checkImages(std::span<const Vec3f> reference, std::span<const Vec3f> test, int width,
                 int height, double pixels_per_degree) {
  PROBELAB_CHECK(width > 0 && height > 0 && pixels_per_degree > 0);
  const Size size{width, height};
  PROBELAB_CHECK_EQ(reference.size(), size.count());
  PROBELAB_CHECK_EQ(test.size(), size.count());
  requireFinite(reference, "reference image");
  requireFinite(test, "image");
  return size;
}

std::vector<Vec3d> mapValues(std::span<const Vec3f> pixels, auto&& curve) {
  std::vector<Vec3d> mapped(pixels.size());
  forEachPixel(pixels.size(), [&](std::size_t i) {
    for (std::size_t c = 0; c < 3; ++c)
      mapped[i][c] = std::clamp(curve(double(pixels[i][c])), 0.0, 1.0);
  });
  return mapped;
}

// (k0 x^2 + k1 x + k2) / (k3 x^2 + k4 x + k5): ACES as fitted by Narkowicz, x scaled by 0.6.
constexpr std::array<double, 6> kAces = {0.6 * 0.6 * 2.51, 0.6 * 0.03, 0,
                                         0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14};

double acesCurve(double x) {
  x = std::max(x, 0.0);
  return (kAces[0] * x * x + kAces[1] * x + kAces[2]) /
         (kAces[3] * x * x + kAces[4] * x + kAces[5]);
}

}  // namespace

FlipResult ldrFlip(std::span<const Vec3f> reference, std::span<const Vec3f> test, int width,
                   int height, double pixels_per_degree) {
  const Size size = checkImages(reference, test, width, height, pixels_per_degree);
  const auto same = [](double v) { return v; };
  return makeResult(
      flipMap(mapValues(reference, same), mapValues(test, same), size, pixels_per_degree));
}

FlipExposureRange flipExposures(double start, double stop) {
  if (!std::isfinite(start) || !std::isfinite(stop) || start > stop)
    throwInput("flip: exposures from {} to {}: start must not be above stop", start, stop);
  if (std::abs(start) > kMostStops || std::abs(stop) > kMostStops)
    throwInput("flip: exposures from {} to {}: beyond {} stops everything is black or white", start,
               stop, kMostStops);
  return {start, stop, std::max(2, static_cast<int>(std::ceil(stop - start)))};
}

FlipExposureRange automaticFlipExposures(std::span<const Vec3f> reference) {
  PROBELAB_CHECK(!reference.empty());
  requireFinite(reference, "reference image");
  std::vector<double> values;
  for (const Vec3f& p : reference) values.push_back(luminance(Vec3d(p)));
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  const double median = n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  if (!(median > 0))
    throwInput(
        "flip: half of the reference or more is black, so exposures cannot be chosen "
        "automatically; give start and stop ([flip] in the scene's TOML)");
  const double a = kAces[0] - kAutomaticLevel * kAces[3];
  const double b = kAces[1] - kAutomaticLevel * kAces[4];
  const double c = kAces[2] - kAutomaticLevel * kAces[5];
  const double level = (-b + std::sqrt(b * b - 4 * a * c)) / (2 * a);
  return flipExposures(std::log2(level / values.back()), std::log2(level / median));
}

FlipResult hdrFlip(std::span<const Vec3f> reference, std::span<const Vec3f> test, int width,
                   int height, const FlipExposureRange& exposures, double pixels_per_degree) {
  const Size size = checkImages(reference, test, width, height, pixels_per_degree);
  PROBELAB_CHECK(exposures.count > 0);
  Plane largest(size.count(), 0.0);
  for (int e = 0; e < exposures.count; ++e) {
    throwIfInterrupted();
    const double share = exposures.count > 1 ? double(e) / (exposures.count - 1) : 0.0;
    const double gain = std::exp2(exposures.start + share * (exposures.stop - exposures.start));
    const auto expose = [&](double v) { return acesCurve(gain * v); };
    const Plane map =
        flipMap(mapValues(reference, expose), mapValues(test, expose), size, pixels_per_degree);
    for (std::size_t i = 0; i < map.size(); ++i) largest[i] = std::max(largest[i], map[i]);
  }
  return makeResult(largest);
}

}  // namespace probelab
