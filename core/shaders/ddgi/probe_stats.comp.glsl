// SPDX-License-Identifier: Apache-2.0
// What a probe's irradiance texels say after an update: (mean luminance, deviation over mean of the
// luminance, variability, lit texels). Variability is the sum over texels that are not black of the
// coefficient of variation of the two stored values before and after, |a - b| / sqrt 2 over
// (a + b) / 2.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/texels.glsl"

BUFFER(BIND_STATS, writeonly, Stats, vec4 stats[]);  // [probe]

layout(push_constant, scalar) uniform Push {
  uint probe_count;
  uint texels;  // interior texels a side
  WordArray before;
  WordArray after;
  float gamma;
  uint unused;
} push;

const vec3 kLuminance = vec3(0.2126, 0.7152, 0.0722);

void main() {
  uint probe = gl_GlobalInvocationID.x;
  if (probe >= push.probe_count) return;
  uint n = push.texels;
  uint side = n + 2u * PL_BORDER;
  float sum = 0.0, sum_of_squares = 0.0, variation = 0.0, lit = 0.0;
  for (uint t = 0u; t < n * n; ++t) {
    uint at = (probe * side + t / n + PL_BORDER) * side + t % n + PL_BORDER;
    vec3 after = loadIrradiance(push.after, at);
    float a = dot(loadIrradiance(push.before, at), kLuminance);
    float b = dot(after, kLuminance);
    if (a + b > 0.0) {
      variation += abs(a - b) * 1.4142135 / (a + b);
      lit += 1.0;
    }
    float linear = dot(pow(after, vec3(push.gamma)), kLuminance);
    sum += linear;
    sum_of_squares += linear * linear;
  }
  float count = float(n * n);
  float mean = sum / count;
  float deviation = sqrt(max(sum_of_squares / count - mean * mean, 0.0));
  stats[probe] = vec4(mean, mean > 0.0 ? deviation / mean : 0.0, variation, lit);
}
