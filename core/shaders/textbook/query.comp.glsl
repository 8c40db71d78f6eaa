// SPDX-License-Identifier: Apache-2.0
// The field at given points as [RTXGI] 1.3.7 publishes it: an invocation a point, the eight probes
// around it, irradiance and distance through the bilinear sampler. Faded out over one spacing
// outside the lattice. Storage: see blend.comp.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/octahedral.h"
#include "textbook/constants.h"

struct Point {
  vec3 position;
  vec3 normal;
  vec3 view;
};

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, scalar) readonly buffer Points { Point points[]; };
layout(set = 0, binding = 1) writeonly buffer Results { vec4 results[]; };
layout(set = 0, binding = 2) uniform sampler2DArray irradiance_atlas;
layout(set = 0, binding = 3) uniform sampler2DArray distance_atlas;
layout(push_constant, scalar) uniform Push { TextbookQuery push; };

// Texture coordinates of an octahedral coordinate in [-1, 1]^2 in a probe's tile.
vec3 atlasCoordinates(ivec3 probe, vec2 octahedral, float texels, vec2 inverse_size) {
  vec2 centre = vec2(probe.xz) * texels + 0.5 * texels;
  return vec3((centre + octahedral * (0.5 * texels - 1.0)) * inverse_size, float(probe.y));
}

float blendWeight(vec3 position, ivec3 counts) {
  vec3 extent = 0.5 * push.spacing * vec3(counts - 1);
  vec3 outside = abs(position - push.first - extent) - extent;
  vec3 weight = 1.0 - clamp(outside / push.spacing, 0.0, 1.0);
  return weight.x * weight.y * weight.z;
}

vec3 queryField(Point point, ivec3 counts) {
  vec3 biased = point.position + point.normal * push.normal_bias - point.view * push.view_bias;
  ivec3 base = clamp(ivec3((biased - push.first) / push.spacing), ivec3(0), counts - 1);
  vec3 base_position = push.first + vec3(base) * push.spacing;
  vec3 alpha = clamp((biased - base_position) / push.spacing, 0.0, 1.0);
  vec2 irradiance_scale = 1.0 / vec2(textureSize(irradiance_atlas, 0).xy);
  vec2 distance_scale = 1.0 / vec2(textureSize(distance_atlas, 0).xy);
  vec2 normal_coordinates = octEncode(point.normal);

  vec3 sum = vec3(0.0);
  float weight_sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    ivec3 offset = ivec3(corner, corner >> 1, corner >> 2) & 1;
    ivec3 probe = min(base + offset, counts - 1);
    vec3 probe_position = push.first + vec3(probe) * push.spacing;

    vec3 to_probe = normalize(probe_position - point.position);
    vec3 biased_to_probe = probe_position - biased;
    float distance_m = length(biased_to_probe);
    vec3 trilinear = max(vec3(0.001), mix(1.0 - alpha, alpha, vec3(offset)));

    float wrap = (dot(to_probe, point.normal) + 1.0) * 0.5;
    float weight = wrap * wrap + 0.2;

    vec3 distance_at = atlasCoordinates(probe, octEncode(-biased_to_probe), PL_MOMENT_TEXELS,
                                        distance_scale);
    vec2 moments = textureLod(distance_atlas, distance_at, 0.0).rg;
    float variance = abs(moments.x * moments.x - moments.y);
    float chebyshev = 1.0;
    if (distance_m > moments.x) {
      float excess = distance_m - moments.x;
      chebyshev = variance / (variance + excess * excess);
      chebyshev = max(chebyshev * chebyshev * chebyshev, 0.0);
    }
    weight = max(0.000001, weight * max(0.05, chebyshev));
    if (weight < 0.2) weight *= weight * weight * (1.0 / (0.2 * 0.2));
    weight *= trilinear.x * trilinear.y * trilinear.z;

    vec3 irradiance_at =
        atlasCoordinates(probe, normal_coordinates, PL_IRRADIANCE_TEXELS, irradiance_scale);
    vec3 stored = textureLod(irradiance_atlas, irradiance_at, 0.0).rgb;
    sum += weight * pow(stored, vec3(push.decode_exponent));
    weight_sum += weight;
  }
  if (weight_sum == 0.0) return vec3(0.0);
  vec3 mean = sum / weight_sum;
  return 3.14159265358979 * mean * mean;
}

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.point_count) return;
  ivec3 counts = ivec3(push.count_x, push.count_y, push.count_z);
  Point point = points[i];
  vec3 irradiance = vec3(0.0);
  float volume_weight = blendWeight(point.position, counts);
  if (volume_weight > 0.0) irradiance = volume_weight * queryField(point, counts);
  results[i] = vec4(irradiance, 1.0);
}
