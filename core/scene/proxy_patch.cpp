// SPDX-License-Identifier: Apache-2.0
#include "proxy_patch.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <tuple>

namespace probelab {
namespace {

// One face's use of an edge: `corner` is where the face's half-edge starts.
struct EdgeUse {
  uint32_t low, high;  // the edge's ends, low < high
  uint32_t face, corner;
  bool forward;  // from low to high
};

bool hasArea(const Corners& face, std::span<const Vec3f> positions) {
  const Vec3d a(positions[face[0]]), b(positions[face[1]]), c(positions[face[2]]);
  const Vec3d n = cross(b - a, c - a);
  const double longest = std::max({dot(b - a, b - a), dot(c - a, c - a), dot(c - b, c - b)});
  // Twice the area over the longest edge squared is the height over that edge; fp32 coordinates
  // tell no smaller one from a line.
  return length(n) > 1e-7 * longest;
}

std::vector<bool> findAside(std::span<const Corners> faces, std::span<const Vec3f> positions) {
  std::vector<bool> aside(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) aside[f] = !hasArea(faces[f], positions);
  return aside;
}

std::vector<EdgeUse> sortedEdges(std::span<const Corners> faces, const std::vector<bool>& aside) {
  std::vector<EdgeUse> uses;
  uses.reserve(3 * faces.size());
  for (uint32_t f = 0; f < faces.size(); ++f) {
    if (aside[f]) continue;
    for (uint32_t c = 0; c < 3; ++c) {
      const uint32_t from = faces[f][c], to = faces[f][(c + 1) % 3];
      uses.push_back({std::min(from, to), std::max(from, to), f, c, from < to});
    }
  }
  std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
    return std::tie(a.low, a.high, a.face) < std::tie(b.low, b.high, b.face);
  });
  return uses;
}

// Corners of faces (3 * face + corner) that are one vertex of the patch.
class CornerSets {
 public:
  explicit CornerSets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  uint32_t find(uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parent_;
};

// Joins the corners at both ends of each manifold edge; the corners of all others go to `open`.
void joinAcrossEdges(std::span<const EdgeUse> uses, CornerSets& sets, std::vector<uint32_t>& open) {
  const auto start = [](const EdgeUse& u) { return 3 * u.face + u.corner; };
  const auto end = [](const EdgeUse& u) { return 3 * u.face + (u.corner + 1) % 3; };
  for (std::size_t i = 0, n = 0; i < uses.size(); i += n) {
    n = 1;
    while (i + n < uses.size() && uses[i + n].low == uses[i].low &&
           uses[i + n].high == uses[i].high)
      ++n;
    const EdgeUse& a = uses[i];
    if (n == 2 && a.forward != uses[i + 1].forward) {
      sets.join(start(a), end(uses[i + 1]));
      sets.join(end(a), start(uses[i + 1]));
    } else {
      for (std::size_t k = i; k < i + n; ++k)
        open.push_back(start(uses[k])), open.push_back(end(uses[k]));
    }
  }
}

}  // namespace

std::vector<uint32_t> weldExactly(std::span<const Vec3f> positions) {
  // By bits: a total order whatever the numbers are.
  const auto key = [&](uint32_t i) {
    const Vec3f p = positions[i] + Vec3f(0.0f);
    return std::array{std::bit_cast<uint32_t>(p.x), std::bit_cast<uint32_t>(p.y),
                      std::bit_cast<uint32_t>(p.z), i};
  };
  std::vector<std::array<uint32_t, 4>> keys(positions.size());
  for (uint32_t i = 0; i < keys.size(); ++i) keys[i] = key(i);
  std::sort(keys.begin(), keys.end());
  std::vector<uint32_t> welded(positions.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const bool same =
        i > 0 && std::equal(keys[i].begin(), keys[i].begin() + 3, keys[i - 1].begin());
    welded[keys[i][3]] = same ? welded[keys[i - 1][3]] : keys[i][3];
  }
  return welded;
}

Patch makePatch(std::span<const Corners> faces, std::span<const Vec3f> positions,
                const std::vector<bool>& shared) {
  constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  Patch patch;
  patch.aside = findAside(faces, positions);
  CornerSets sets(3 * faces.size());
  std::vector<uint32_t> open;
  joinAcrossEdges(sortedEdges(faces, patch.aside), sets, open);
  std::vector<uint32_t> vertex_of(3 * faces.size(), kNone);  // [root corner]
  std::vector<uint32_t> first_of(positions.size(), kNone);   // [position] its first vertex
  patch.faces.resize(faces.size());
  for (uint32_t i = 0; i < 3 * faces.size(); ++i) {
    if (patch.aside[i / 3]) continue;
    const uint32_t root = sets.find(i), position = faces[i / 3][i % 3];
    if (vertex_of[root] == kNone) {
      const auto vertex = static_cast<uint32_t>(patch.position.size());
      vertex_of[root] = vertex;
      patch.position.push_back(position);
      patch.locked.push_back(shared[position]);
      if (first_of[position] == kNone)
        first_of[position] = vertex;
      else
        patch.locked[first_of[position]] = patch.locked[vertex] = true;  // two fans at one place
    }
    patch.faces[i / 3][i % 3] = vertex_of[root];
  }
  for (const uint32_t corner : open) patch.locked[vertex_of[sets.find(corner)]] = true;
  return patch;
}

}  // namespace probelab
