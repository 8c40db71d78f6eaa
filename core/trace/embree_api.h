// SPDX-License-Identifier: Apache-2.0
// Embree 3.13 and 4 under one spelling. Included by embree_scene.cpp and bare_loop.cpp only.
#pragma once

#if PROBELAB_EMBREE >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace probelab {

// The per-call state of rtcIntersect1 and rtcOccluded1.
class TraceContext {
 public:
#if PROBELAB_EMBREE >= 4
  TraceContext() {
    rtcInitIntersectArguments(&intersect_);
    rtcInitOccludedArguments(&occluded_);
  }
  void intersect(RTCScene scene, RTCRayHit& ray) { rtcIntersect1(scene, &ray, &intersect_); }
  void occlude(RTCScene scene, RTCRay& ray) { rtcOccluded1(scene, &ray, &occluded_); }

 private:
  RTCIntersectArguments intersect_;
  RTCOccludedArguments occluded_;
#else
  TraceContext() { rtcInitIntersectContext(&context_); }
  void intersect(RTCScene scene, RTCRayHit& ray) { rtcIntersect1(scene, &context_, &ray); }
  void occlude(RTCScene scene, RTCRay& ray) { rtcOccluded1(scene, &context_, &ray); }

 private:
  RTCIntersectContext context_;
#endif
};

}  // namespace probelab
