// SPDX-License-Identifier: Apache-2.0
// glTF/GLB and scene TOML -> Scene.
#pragma once

#include <filesystem>
#include <string>

#include "scene/scene.h"

namespace probelab {

// Loads a .gltf/.glb or a scene .toml, in its first lighting state. Throws InputError naming the
// file, the element and what to do. Oddities that do not stop it are in Scene::warnings.
//
// Only the glTF's default scene counts, and of its materials those that its triangles use. A
// TOML's cameras come before the glTF's, its lights after them. Lights and cameras of a glTF are
// called as their nodes; a name that comes again gets "#2". URIs inside a glTF cannot leave its
// folder; the paths in a TOML may.
//
// Keys of a scene TOML; all are optional but those marked *, * within their table:
//   gltf, time_s                    without gltf, [volume] is needed
//   turn_deg                        turns all of it about +Y, counter-clockwise seen from above; not
//                                   with a [volume] or a sky image
//   [sky]        image | radiance, linear        the image is an equirectangular EXR of scan lines
//   [[light]]    name*, type*, intensity*, color, position, direction, range_m, inner_cone_deg (0),
//                outer_cone_deg (45)             position* and direction* as the type has them
//   [[camera]]   name*, position*, target*, vertical_fov_deg (45)
//   [volume]     min*, max*                      default: the geometry's box, 1 % of its diagonal
//   [receivers]  seeds                           larger on every side; seeds lie inside
//   [flip]       start*, stop*
//   [[state]]    name*, split, lights = { NAME = { color, intensity, position, direction } },
//                sky_scale                       each state starts from the scene as it stands
Scene loadScene(const std::filesystem::path& path);

}  // namespace probelab
