// SPDX-License-Identifier: Apache-2.0
// glTF materials -> diffuse materials and the textures they use.
#pragma once

#include <map>
#include <vector>

#include "gltf_file.h"
#include "scene/scene.h"

namespace probelab {

// Converts materials as primitives ask for them, so that what nothing uses costs nothing.
class GltfMaterials {
 public:
  GltfMaterials(const GltfFile& gltf, Warnings& warnings) : gltf_(gltf), warnings_(warnings) {}

  // Index into materials() of the model's material, -1: glTF's default one. Throws InputError
  // naming the material for factors outside [0, 1], emission that is negative or not finite, and
  // images that cannot be read.
  uint32_t use(int gltf_material);

  // The highest TEXCOORD set that a material reads, -1: none.
  int highestUvSet(uint32_t material) const;

  std::vector<Material>& materials() { return materials_; }
  std::vector<Texture>& textures() { return textures_; }

 private:
  Material convert(int gltf_material);
  void convertEmission(const tinygltf::Material& source, const std::string& element, Material& out);
  template <class TextureInfo>
  TextureUse textureUse(const TextureInfo& info, const std::string& element);
  int textureOf(int image, const std::string& element);
  void warnIfBlackMetal(const Material& material, const std::string& element);

  const GltfFile& gltf_;
  Warnings& warnings_;
  std::map<int, uint32_t> material_of_;
  std::map<int, int> texture_of_;  // by glTF image
  std::vector<Material> materials_;
  std::vector<Texture> textures_;
};

}  // namespace probelab
