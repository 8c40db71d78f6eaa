// SPDX-License-Identifier: Apache-2.0
#include "ddgi/scene_buffers.h"

#include "ddgi/constants.h"
#include "trace/light_data.h"

namespace probelab {
namespace {

template <class T>
GpuBuffer deviceArray(GpuContext& context, const std::vector<T>& values, const char* name) {
  return createBufferFrom(context, values, MemoryUse::device, name);
}

GpuMaterial gpuMaterial(const MaterialData& m) {
  GpuMaterial material{};
  material.base_color = m.base_color;
  material.metallic = m.metallic;
  material.emission = m.emission;
  material.base_alpha = m.base_alpha;
  material.base_color_texture = m.base_color_texture;
  material.metallic_texture = m.metallic_texture;
  material.emission_texture = m.emission_texture;
  material.alpha_cutoff = m.alpha_cutoff;
  material.flags =
      (m.double_sided ? kMaterialDoubleSided : 0u) | (m.alpha_mask ? kMaterialAlphaMask : 0u);
  return material;
}

void uploadSky(GpuContext& context, const Sky& sky, SceneBuffers& buffers) {
  SkyData data{};
  data.radiance = sky.radiance * sky.scale;
  data.linear = sky.linear;
  data.width = sky.width;
  data.height = sky.height;
  buffers.sky = deviceArray(context, std::vector<SkyData>{data}, "sky");
  if (!buffers.features.sky_image) return;
  std::vector<Vec3f> image = sky.image;
  for (Vec3f& texel : image) texel *= sky.scale;
  buffers.sky_image = deviceArray(context, image, "sky image");
}

}  // namespace

SceneBuffers uploadScene(GpuContext& context, const Scene& scene, TextureLevels levels) {
  SceneBuffers buffers;
  buffers.features = sceneFeatures(scene);
  const SceneFeatures& features = buffers.features;
  const Geometry& geometry = *scene.geometry;
  if (features.triangles) {
    const MaterialTable table = makeMaterialTable(scene, levels);
    std::vector<GpuMaterial> materials;
    for (const MaterialData& m : table.materials) materials.push_back(gpuMaterial(m));
    buffers.triangles = deviceArray(context, geometry.triangles, "triangles");
    buffers.positions = deviceArray(context, geometry.positions, "positions");
    buffers.materials = deviceArray(context, materials, "materials");
    if (features.shading_normals)
      buffers.normals = deviceArray(context, geometry.normals, "normals");
    if (features.textures) {
      const std::vector<Vec2f> none(geometry.positions.size());
      buffers.uv0 = deviceArray(context, geometry.uv0.empty() ? none : geometry.uv0, "uv 0");
      buffers.uv1 = deviceArray(context, geometry.uv1.empty() ? none : geometry.uv1, "uv 1");
      buffers.texels = deviceArray(context, table.texels, "texels");
    }
  }
  if (features.sky) uploadSky(context, scene.sky, buffers);
  const std::vector<LightData> lights = makeLightData(scene);
  buffers.light_count = static_cast<uint32_t>(lights.size());
  if (!lights.empty()) buffers.lights = deviceArray(context, lights, "lights");
  return buffers;
}

Defines sceneDefines(const SceneFeatures& features) {
  const auto flag = [](const char* name, bool on) {
    return std::pair<std::string, std::string>(name, on ? "1" : "0");
  };
  return {flag("PL_TRIANGLES", features.triangles),
          flag("PL_TEXTURES", features.textures),
          flag("PL_ALPHA_MASK", features.alpha_mask),
          flag("PL_DOUBLE_SIDED", features.double_sided),
          flag("PL_EMISSION", features.emission),
          flag("PL_SHADING_NORMALS", features.shading_normals),
          flag("PL_SKY", features.sky),
          flag("PL_SKY_IMAGE", features.sky_image),
          flag("PL_LIGHT_DIRECTIONAL", features.directional_lights),
          flag("PL_LIGHT_POINT", features.point_lights),
          flag("PL_LIGHT_SPOT", features.spot_lights)};
}

SceneAddresses sceneAddresses(const SceneBuffers& buffers) {
  const auto of = [](const GpuBuffer& buffer) { return buffer ? buffer.address() : 0; };
  return {of(buffers.triangles), of(buffers.positions), of(buffers.materials), of(buffers.normals),
          of(buffers.uv0),       of(buffers.uv1),       of(buffers.texels)};
}

}  // namespace probelab
