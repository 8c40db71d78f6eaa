// SPDX-License-Identifier: Apache-2.0
// Octahedral maps of the sphere (Cigolle et al., JCGT 3(2), 2014), with a border of one texel as in
// [M19] or without.
#ifndef PROBELAB_SHARED_OCTAHEDRAL_H
#define PROBELAB_SHARED_OCTAHEDRAL_H

#include "shared/language.h"

PL_NAMESPACE_BEGIN

PL_FUNCTION REAL signNotZero(REAL v) { return v >= REAL(0) ? REAL(1) : REAL(-1); }

// Direction (any positive length) -> [-1, 1]^2.
PL_FUNCTION VEC2 octEncode(VEC3 d) {
  REAL scale = REAL(1) / (abs(d.x) + abs(d.y) + abs(d.z));
  REAL x = d.x * scale;
  REAL y = d.y * scale;
  REAL folded_x = (REAL(1) - abs(y)) * signNotZero(x);
  REAL folded_y = (REAL(1) - abs(x)) * signNotZero(y);
  bool upper = d.z >= REAL(0);
  return VEC2(upper ? x : folded_x, upper ? y : folded_y);
}

// [-1, 1]^2 -> unit direction.
PL_FUNCTION VEC3 octDecode(VEC2 p) {
  REAL z = REAL(1) - abs(p.x) - abs(p.y);
  VEC3 d = VEC3(p.x, p.y, z);
  if (z < REAL(0))
    d = VEC3((REAL(1) - abs(p.y)) * signNotZero(p.x), (REAL(1) - abs(p.x)) * signNotZero(p.y), z);
  return normalize(d);
}

// Direction of the centre of interior texel (x, y) of a map with n x n interior texels.
PL_FUNCTION VEC3 texelDirection(REAL x, REAL y, REAL n) {
  return octDecode(VEC2((x + REAL(0.5)) / n * REAL(2) - REAL(1),
                        (y + REAL(0.5)) / n * REAL(2) - REAL(1)));
}

// Place in an atlas tile of the texel (x, y) of a map with n x n interior texels, x and y from -1 to
// n. With a border of one texel the tile holds them all. Without one they are taken from where the
// map continues: across an edge the texel mirrored along that edge, across a corner the opposite
// corner.
PL_INLINE int tileTexel(int x, int y, int n, int border) {
  if (border != 0) return (y + 1) * (n + 2) + x + 1;
  int cx = clamp(x, 0, n - 1);
  int wy = x == cx ? y : n - 1 - y;
  int cy = clamp(wy, 0, n - 1);
  int wx = wy == cy ? cx : n - 1 - cx;
  return cy * n + wx;
}

// The four texels that a bilinear reading at a point of the map uses, as places in the tile: (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1).
PL_STRUCT OctTaps {
  int texel_00;
  int texel_10;
  int texel_01;
  int texel_11;
  REAL fraction_x;
  REAL fraction_y;
};

PL_FUNCTION OctTaps PL_OF_T mapTaps(VEC2 e, int n, int border) {
  REAL u = (e.x * REAL(0.5) + REAL(0.5)) * REAL(n) - REAL(0.5);
  REAL v = (e.y * REAL(0.5) + REAL(0.5)) * REAL(n) - REAL(0.5);
  int x = min(floorToInt(u), n - 1);
  int y = min(floorToInt(v), n - 1);
  OctTaps PL_OF_T taps;
  taps.texel_00 = tileTexel(x, y, n, border);
  taps.texel_10 = tileTexel(x + 1, y, n, border);
  taps.texel_01 = tileTexel(x, y + 1, n, border);
  taps.texel_11 = tileTexel(x + 1, y + 1, n, border);
  taps.fraction_x = u - REAL(x);
  taps.fraction_y = v - REAL(y);
  return taps;
}

// The same in direction d (any positive length).
PL_FUNCTION OctTaps PL_OF_T octTaps(VEC3 d, int n, int border) {
  return mapTaps(octEncode(d), n, border);
}

PL_NAMESPACE_END

#endif
