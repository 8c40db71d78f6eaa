// SPDX-License-Identifier: Apache-2.0
// Hits -> surfaces: emission or sky, albedo, normals, the signed distance. Back faces of a
// single-sided material are opaque, black and non-emissive.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"
#include "shared/octahedral.h"
#include "shared/offset.h"

layout(push_constant, scalar) uniform Push {
  uint item_count;
  float cone_area;  // of a ray's cone, 1 m from its origin, in square metres
  RayArray rays;
  HitArray hits;
  SurfaceInOut surfaces;
  SceneAddresses scene;
  Vec3Array sky_image;
} push;

#if PL_TRIANGLES
#include "ddgi/scene.glsl"
#endif
#if PL_SKY
BUFFER(BIND_SKY, readonly, SkyBuffer, SkyData sky);
#endif

vec3 skyRadiance(vec3 direction) {
#if PL_SKY_IMAGE
  return push.sky_image.at[skyTexel(sky, direction)];
#elif PL_SKY
  return linearSky(sky, direction);
#else
  return vec3(0.0);
#endif
}

RaySurface missed(vec3 direction) {
  return RaySurface(vec3(0.0), kMissDistance, vec3(0.0, 1.0, 0.0), 0.0, vec3(0.0), 0.0,
                 skyRadiance(direction), 0u);
}

#if PL_TRIANGLES
RaySurface shade(Ray ray, Hit hit) {
  TriangleData triangle = push.scene.triangles.at[hit.primitive];
  GpuMaterial material = push.scene.materials.at[triangle.material];
  vec3 p0 = push.scene.positions.at[triangle.vertex[0]];
  vec3 p1 = push.scene.positions.at[triangle.vertex[1]];
  vec3 p2 = push.scene.positions.at[triangle.vertex[2]];
  vec3 geometric = normalize(cross(p1 - p0, p2 - p0));
  bool back = dot(geometric, ray.direction) > 0.0;
  bool black = back;
#if PL_DOUBLE_SIDED
  black = back && (material.flags & kMaterialDoubleSided) == 0u;
#endif
  if (back) geometric = -geometric;
  RaySurface surface;
  surface.origin = offsetOrigin(pointOnTriangle(p0, p1, p2, hit.u, hit.v), geometric, geometric);
  surface.distance = black ? -hit.t : hit.t;
  vec2 encoded = octEncode(geometric);
  surface.ng_x = encoded.x;
  surface.ng_y = encoded.y;
  surface.normal = geometric;
#if PL_SHADING_NORMALS
  vec3 shading = push.scene.normals.at[triangle.vertex[0]] * (1.0 - hit.u - hit.v) +
                 push.scene.normals.at[triangle.vertex[1]] * hit.u + push.scene.normals.at[triangle.vertex[2]] * hit.v;
  float length_sq = dot(shading, shading);
  if (length_sq > 1e-12) {
    shading *= inversesqrt(length_sq);
    surface.normal = dot(shading, geometric) < 0.0 ? -shading : shading;
  }
#endif
  surface.albedo = vec3(0.0);
  surface.radiance = vec3(0.0);
  surface.hit = black ? 0u : 1u;
  if (!black) {
    float footprint = 0.0;
#if PL_TEXTURE_LOD
    footprint =
        footprintTriangles(push.cone_area, hit.t, cross(p1 - p0, p2 - p0), ray.direction);
#endif
    surface.albedo = materialAlbedo(material, triangle, hit.u, hit.v, footprint);
#if PL_EMISSION
    surface.radiance = materialEmission(material, triangle, hit.u, hit.v, footprint);
#endif
  }
  return surface;
}
#endif

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
#if PL_TRIANGLES
  if (push.hits.at[i].primitive != kNoHit) {
    push.surfaces.at[i] = shade(push.rays.at[i], push.hits.at[i]);
    return;
  }
#endif
  push.surfaces.at[i] = missed(push.rays.at[i].direction);
}
