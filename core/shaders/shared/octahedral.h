// SPDX-License-Identifier: Apache-2.0
// Octahedral maps of the sphere, with a border of one texel (Cigolle et al., JCGT 3(2), 2014; the
// border as in [M19]).
#ifndef PROBELAB_SHARED_OCTAHEDRAL_H
#define PROBELAB_SHARED_OCTAHEDRAL_H

#include "shared/language.h"

PL_NAMESPACE_BEGIN

PL_FUNCTION REAL signNotZero(REAL v) { return v >= REAL(0) ? REAL(1) : REAL(-1); }

// Direction (any positive length) -> [-1, 1]^2.
PL_FUNCTION VEC2 octEncode(VEC3 d) {
  REAL l1 = abs(d.x) + abs(d.y) + abs(d.z);
  VEC2 p = VEC2(d.x / l1, d.y / l1);
  if (d.z >= REAL(0)) return p;
  return VEC2((REAL(1) - abs(p.y)) * signNotZero(p.x), (REAL(1) - abs(p.x)) * signNotZero(p.y));
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

// The four texels that a bilinear reading in direction d uses, in a map with n x n interior texels:
// (x, y) to (x + 1, y + 1) counted with the border, so all within [0, n + 1].
PL_STRUCT OctTaps {
  int x;
  int y;
  REAL fraction_x;
  REAL fraction_y;
};

PL_FUNCTION OctTaps PL_OF_T octTaps(VEC3 d, int n) {
  VEC2 e = octEncode(d);
  REAL u = (e.x * REAL(0.5) + REAL(0.5)) * REAL(n) + REAL(0.5);
  REAL v = (e.y * REAL(0.5) + REAL(0.5)) * REAL(n) + REAL(0.5);
  OctTaps PL_OF_T taps;
  taps.x = min(floorToInt(u), n);
  taps.y = min(floorToInt(v), n);
  taps.fraction_x = u - REAL(taps.x);
  taps.fraction_y = v - REAL(taps.y);
  return taps;
}

PL_NAMESPACE_END

#endif
