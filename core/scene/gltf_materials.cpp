// SPDX-License-Identifier: Apache-2.0
#include "gltf_materials.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "image_decode.h"

namespace probelab {
namespace {

constexpr int kRepeat = 10497, kClamp = 33071, kMirror = 33648, kNearest = 9728;

double numberOr(const tinygltf::Value& object, const char* key, double fallback) {
  const tinygltf::Value& value = object.Get(key);
  return value.IsNumber() ? value.GetNumberAsDouble() : fallback;
}

double elementOr(const tinygltf::Value& object, const char* key, int i, double fallback) {
  const tinygltf::Value& value = object.Get(key);
  return value.IsArray() ? value.Get(i).GetNumberAsDouble() : fallback;
}

// KHR_texture_transform: T R S. A positive rotation turns (1, 0) towards (0, -1): counter-clockwise
// as an image is looked at, with v downwards. This is what the extension's text and its test model
// ask for, and the reverse of the GLSL in its overview.
std::array<float, 6> transformOf(const tinygltf::Value& extension) {
  const double ox = elementOr(extension, "offset", 0, 0), oy = elementOr(extension, "offset", 1, 0);
  const double sx = elementOr(extension, "scale", 0, 1), sy = elementOr(extension, "scale", 1, 1);
  const double angle = numberOr(extension, "rotation", 0);
  const double c = std::cos(angle), s = std::sin(angle);
  const double rows[6] = {c * sx, s * sy, ox, -s * sx, c * sy, oy};
  std::array<float, 6> result;
  std::transform(rows, rows + 6, result.begin(), [](double x) { return static_cast<float>(x); });
  return result;
}

TextureWrap wrapOf(const std::string& file, const std::string& element, int mode) {
  if (mode == kRepeat) return TextureWrap::repeat;
  if (mode == kClamp) return TextureWrap::clamp;
  if (mode == kMirror) return TextureWrap::mirror;
  throwInput("{}: {}: texture wrap mode {} is none of repeat, clamp, mirror", file, element, mode);
}

void checkShare(const std::string& file, const std::string& element, const char* what,
                double value) {
  if (!(value >= 0 && value <= 1))
    throwInput("{}: {}: {} is {}, must be within 0 and 1", file, element, what, value);
}

}  // namespace

uint32_t GltfMaterials::use(int gltf_material) {
  const auto [it, added] =
      material_of_.try_emplace(gltf_material, static_cast<uint32_t>(materials_.size()));
  if (added) materials_.push_back(convert(gltf_material));
  return it->second;
}

int GltfMaterials::highestUvSet(uint32_t material) const {
  const Material& m = materials_[material];
  int highest = -1;
  for (const TextureUse* use : {&m.base_color_texture, &m.metallic_texture, &m.emission_texture})
    if (use->used()) highest = std::max(highest, use->uv_set);
  return highest;
}

Material GltfMaterials::convert(int gltf_material) {
  // glTF's default material is white and fully metallic.
  static const tinygltf::Material default_material;
  const tinygltf::Material& source =
      gltf_material < 0 ? default_material : gltf_.model.materials[gltf_material];
  const std::string element = gltf_material < 0
                                  ? "glTF's default material (a primitive names none)"
                                  : elementName("material", gltf_material, source.name);
  const tinygltf::PbrMetallicRoughness& pbr = source.pbrMetallicRoughness;
  Material out;
  out.name = gltf_material < 0 ? "default" : source.name;
  for (int c = 0; c < 4; ++c)
    checkShare(gltf_.path, element, "baseColorFactor", pbr.baseColorFactor[c]);
  checkShare(gltf_.path, element, "metallicFactor", pbr.metallicFactor);
  out.base_color =
      Vec3f(Vec3d(pbr.baseColorFactor[0], pbr.baseColorFactor[1], pbr.baseColorFactor[2]));
  out.base_alpha = static_cast<float>(pbr.baseColorFactor[3]);
  out.metallic = static_cast<float>(pbr.metallicFactor);
  out.double_sided = source.doubleSided;
  if (source.alphaMode == "MASK") {
    if (!std::isfinite(static_cast<float>(source.alphaCutoff)) || source.alphaCutoff < 0)
      throwInput("{}: {}: alphaCutoff is {}, must be 0 or more", gltf_.path, element,
                 source.alphaCutoff);
    out.alpha_mask = true;
    out.alpha_cutoff = static_cast<float>(source.alphaCutoff);
  } else if (source.alphaMode == "BLEND") {
    warnings_.add("{}: {}: alphaMode BLEND is rendered opaque", gltf_.path, element);
  } else if (source.alphaMode != "OPAQUE") {
    throwInput("{}: {}: alphaMode '{}' is none of OPAQUE, MASK, BLEND", gltf_.path, element,
               printable(source.alphaMode));
  }
  // A texture that its factor multiplies by 0 changes nothing and is left out.
  if (maxComponent(out.base_color) > 0 || out.alpha_mask)
    out.base_color_texture = textureUse(pbr.baseColorTexture, element);
  if (out.metallic > 0) out.metallic_texture = textureUse(pbr.metallicRoughnessTexture, element);
  convertEmission(source, element, out);
  warnIfBlackMetal(out, element);
  return out;
}

void GltfMaterials::convertEmission(const tinygltf::Material& source, const std::string& element,
                                    Material& out) {
  double strength = 1;
  const auto extension = source.extensions.find("KHR_materials_emissive_strength");
  if (extension != source.extensions.end())
    strength = numberOr(extension->second, "emissiveStrength", 1);
  for (int c = 0; c < 3; ++c) {
    const double factor = source.emissiveFactor.size() == 3 ? source.emissiveFactor[c] : 0.0;
    const auto radiance = static_cast<float>(factor * strength);
    if (!std::isfinite(radiance) || factor < 0 || strength < 0)
      throwInput("{}: {}: emission {} x {} must be finite and not negative", gltf_.path, element,
                 factor, strength);
    out.emission[c] = radiance;
  }
  if (maxComponent(out.emission) > 0)
    out.emission_texture = textureUse(source.emissiveTexture, element);
}

template <class TextureInfo>
TextureUse GltfMaterials::textureUse(const TextureInfo& info, const std::string& element) {
  TextureUse use;
  if (info.index < 0) return use;
  const tinygltf::Texture& texture = gltf_.model.textures[info.index];
  use.uv_set = info.texCoord;
  const auto extension = info.extensions.find("KHR_texture_transform");
  if (extension != info.extensions.end()) {
    use.transform = transformOf(extension->second);
    use.uv_set = static_cast<int>(numberOr(extension->second, "texCoord", use.uv_set));
    for (const float value : use.transform)
      if (!std::isfinite(value))
        throwInput("{}: {}: its KHR_texture_transform is not finite", gltf_.path, element);
  }
  if (use.uv_set < 0 || use.uv_set > 1)
    throwInput("{}: {}: uses TEXCOORD_{}; sets 0 and 1 are supported", gltf_.path, element,
               use.uv_set);
  if (texture.sampler >= 0) {
    const tinygltf::Sampler& sampler = gltf_.model.samplers[texture.sampler];
    use.wrap_u = wrapOf(gltf_.path, element, sampler.wrapS);
    use.wrap_v = wrapOf(gltf_.path, element, sampler.wrapT);
    use.nearest = sampler.magFilter == kNearest;
  }
  if (texture.source < 0)
    throwInput("{}: {}: texture {} names no PNG or JPEG image", gltf_.path, element, info.index);
  use.texture = textureOf(texture.source, element);
  return use;
}

int GltfMaterials::textureOf(int image, const std::string& element) {
  const auto [it, added] = texture_of_.try_emplace(image, static_cast<int>(textures_.size()));
  if (!added) return it->second;
  const tinygltf::Image& source = gltf_.model.images[image];
  const std::string place = elementName("image", image, source.name);
  if (source.image.empty())
    throwInput("{}: {}: {} '{}' cannot be read", gltf_.path, element, place, printable(source.uri));
  std::string why;
  std::optional<Texture> texture = decodeImage(source.image, why);
  if (!texture)
    throwInput("{}: {}: {} cannot be decoded as PNG or JPEG: {}", gltf_.path, element, place, why);
  texture->name = !source.name.empty() ? source.name : source.uri;
  textures_.push_back(std::move(*texture));
  return it->second;
}

void GltfMaterials::warnIfBlackMetal(const Material& material, const std::string& element) {
  if (material.metallic < 1 || maxComponent(material.base_color) == 0) return;
  if (material.metallic_texture.used()) {
    const std::vector<uint8_t>& texels = textures_[material.metallic_texture.texture].rgba;
    for (std::size_t i = 2; i < texels.size(); i += 4)
      if (texels[i] != 255) return;
  }
  warnings_.add(
      "{}: {}: is fully metallic (glTF's default), so its diffuse albedo is 0; set metallicFactor "
      "to 0 if it should reflect",
      gltf_.path, element);
}

}  // namespace probelab
