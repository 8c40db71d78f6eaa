// SPDX-License-Identifier: Apache-2.0
// Accessors -> plain arrays, with every byte checked to lie inside its buffer. Sparse accessors,
// normalized integers and strides included; nothing is assumed about alignment.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "gltf_file.h"

namespace probelab {

// [element][component], `components` of them (1 SCALAR, 2 VEC2, 3 VEC3, 4 VEC4). All finite.
// Throws InputError naming the file, `element` and the accessor.
std::vector<float> readFloats(const GltfFile& gltf, int accessor, int components,
                              const std::string& element);

// SCALAR of unsigned 8, 16 or 32 bit. Throws InputError likewise.
std::vector<uint32_t> readIndices(const GltfFile& gltf, int accessor, const std::string& element);

// Components of the accessor's type: 1 to 4, or more for matrices.
int componentsOf(const GltfFile& gltf, int accessor);

}  // namespace probelab
