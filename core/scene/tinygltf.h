// SPDX-License-Identifier: Apache-2.0
// The one way to include tinygltf: every file must see the same configuration. No file system
// access of its own (ours is guarded) and no image decoding (ours decodes only what is used).
#pragma once

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_FS
#define TINYGLTF_NO_INCLUDE_JSON
#include <tiny_gltf.h>
