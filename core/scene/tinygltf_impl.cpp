// SPDX-License-Identifier: Apache-2.0
// tinygltf's implementation, compiled here so that its configuration is ours.
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#define TINYGLTF_IMPLEMENTATION
#include "tinygltf.h"
