// SPDX-License-Identifier: Apache-2.0
// The ray-query tracer. PL_TRACE 0: closest hits; 1: occlusion, 1 where something is hit. Cut-out
// materials are tested in the loop; without any the geometry is opaque and the loop is empty.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"

BUFFER(BIND_RAYS, readonly, Rays, Ray rays[]);
#if PL_TRACE == 0
BUFFER(BIND_HITS, writeonly, Hits, Hit hits[]);
#else
BUFFER(BIND_OCCLUDED, writeonly, Occluded, uint occluded[]);
#endif
#if PL_ALPHA_MASK
#include "ddgi/scene.glsl"
// Triangles of one opacity make a geometry; this is where each starts.
BUFFER(BIND_FIRST_TRIANGLES, readonly, FirstTriangles, uint first_triangles[]);
#endif
layout(set = 0, binding = BIND_ACCELERATION_STRUCTURE) uniform accelerationStructureEXT scene_as;

layout(push_constant, scalar) uniform Push { uint item_count; } push;

#if PL_TRACE == 0
const uint kRayFlags = gl_RayFlagsNoneEXT;
#else
const uint kRayFlags = gl_RayFlagsTerminateOnFirstHitEXT;
#endif
#if PL_ALPHA_MASK
const uint kOpaque = 0u;
#else
const uint kOpaque = gl_RayFlagsOpaqueEXT;
#endif

uint triangleOf(int geometry, int primitive) {
#if PL_ALPHA_MASK
  return first_triangles[geometry] + uint(primitive);
#else
  return uint(primitive);
#endif
}

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  Ray ray = rays[i];
  Hit hit = Hit(ray.t_max, kNoHit, 0.0, 0.0);
  if (ray.t_max > ray.t_min) {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene_as, kRayFlags | kOpaque, 0xffu, ray.origin, ray.t_min,
                          ray.direction, ray.t_max);
    while (rayQueryProceedEXT(query)) {
#if PL_ALPHA_MASK
      if (rayQueryGetIntersectionTypeEXT(query, false) ==
          gl_RayQueryCandidateIntersectionTriangleEXT) {
        TriangleData triangle =
            triangles[triangleOf(rayQueryGetIntersectionGeometryIndexEXT(query, false),
                                 rayQueryGetIntersectionPrimitiveIndexEXT(query, false))];
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);
        if (!materialCutsOut(materials[triangle.material], triangle, uv.x, uv.y))
          rayQueryConfirmIntersectionEXT(query);
      }
#endif
    }
    if (rayQueryGetIntersectionTypeEXT(query, true) ==
        gl_RayQueryCommittedIntersectionTriangleEXT) {
      vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
      hit = Hit(rayQueryGetIntersectionTEXT(query, true),
                triangleOf(rayQueryGetIntersectionGeometryIndexEXT(query, true),
                           rayQueryGetIntersectionPrimitiveIndexEXT(query, true)),
                uv.x, uv.y);
    }
  }
#if PL_TRACE == 0
  hits[i] = hit;
#else
  occluded[i] = hit.primitive == kNoHit ? 0u : 1u;
#endif
}
