// SPDX-License-Identifier: Apache-2.0
// The ray-query tracer. PL_TRACE 0: closest hits; 1: occlusion, 1 where something is hit. Cut-out
// materials are tested in the loop; without any the geometry is opaque and the loop is empty.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_GOOGLE_include_directive : require
#include "ddgi/stage.glsl"
#include "ddgi/constants.h"

layout(push_constant, scalar) uniform Push {
  uint item_count;
  uint unused;
  RayArray rays;
#if PL_TRACE == 0
  HitOutput hits;
#else
  WordOutput occluded;
#endif
  WordArray first_triangles;  // triangles of one opacity make a geometry; where each starts
  SceneAddresses scene;
} push;

#if PL_ALPHA_MASK
#include "ddgi/scene.glsl"
#endif
layout(set = 0, binding = BIND_ACCELERATION_STRUCTURE) uniform accelerationStructureEXT scene_as;

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
  return push.first_triangles.at[geometry] + uint(primitive);
#else
  return uint(primitive);
#endif
}

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.item_count) return;
  Ray ray = push.rays.at[i];
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
            push.scene.triangles.at[triangleOf(rayQueryGetIntersectionGeometryIndexEXT(query, false),
                                 rayQueryGetIntersectionPrimitiveIndexEXT(query, false))];
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);
        if (!materialCutsOut(push.scene.materials.at[triangle.material], triangle, uv.x, uv.y))
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
  push.hits.at[i] = hit;
#else
  push.occluded.at[i] = hit.primitive == kNoHit ? 0u : 1u;
#endif
}
