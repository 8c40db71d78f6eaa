// SPDX-License-Identifier: GPL-3.0-or-later
// `render --traced-visibility`: what the camera sees with the field's answer under traced
// visibility in place of the moments'.
#pragma once

#include <span>

#include "ddgi/field_camera.h"
#include "ddgi/snapshot.h"
#include "trace/surface.h"

namespace probelab {

// Of what FieldCamera::shade gave for these rays, [ray], takes the field's irradiance where
// something reflects, and its bounce, and puts in their place those of queryExactVisibility. The
// rays are the camera's, `embree` and `materials` those of the scene that it sees.
void replaceVisibility(std::span<const Ray> rays, const FieldSnapshot& field, const Params& params,
                       const Scene& scene, const EmbreeScene& embree,
                       const MaterialTable& materials, ShadedRays& shaded);

}  // namespace probelab
