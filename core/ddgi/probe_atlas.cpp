// SPDX-License-Identifier: Apache-2.0
#include "ddgi/probe_atlas.h"

#include "base/error.h"
#include "ddgi/texels.h"

namespace probelab {
namespace {

uint32_t wordsOf(const ProbeAtlas& atlas) {
  return atlas.kind == AtlasKind::irradiance ? irradianceWords(atlas.format)
                                             : momentWords(atlas.format);
}

template <class T, class Unpack>
std::vector<T> downloadTexels(GpuContext& context, const ProbeAtlas& atlas, int copy,
                              const Unpack& unpack) {
  const std::size_t texels = atlas.probes * atlas.side() * atlas.side();
  const uint32_t words = wordsOf(atlas);
  const auto stored = downloadArray<uint32_t>(context, atlas.copies[static_cast<std::size_t>(copy)],
                                              texels * words);
  std::vector<T> unpacked(texels);
  for (std::size_t i = 0; i < texels; ++i) unpacked[i] = unpack(&stored[i * words]);
  return unpacked;
}

}  // namespace

ProbeAtlas makeAtlas(GpuContext& context, AtlasKind kind, const Params& params, uint64_t probes,
                     bool accumulate) {
  const AtlasSides sides = atlasSides(params);
  const bool irradiance = kind == AtlasKind::irradiance;
  const std::string name = irradiance ? "irradiance" : "moments";
  ProbeAtlas atlas;
  atlas.kind = kind;
  atlas.texels = irradiance ? sides.irradiance : sides.moments;
  atlas.border = sides.border;
  atlas.format = irradiance ? params.irradiance_format : params.moment_format;
  atlas.encoding = irradiance ? 0 : params.moment_encoding;
  atlas.probes = probes;
  const uint64_t texels = probes * atlas.side() * atlas.side();
  for (GpuBuffer& copy : atlas.copies)
    copy = createBuffer(context, texels * wordsOf(atlas) * 4, MemoryUse::device, name + " atlas");
  if (accumulate)
    atlas.average = createBuffer(
        context, probes * static_cast<uint64_t>(atlas.texels * atlas.texels) * sizeof(Vec3f),
        MemoryUse::device, name + " average");
  return atlas;
}

std::vector<Vec3f> downloadIrradiance(GpuContext& context, const ProbeAtlas& atlas, int copy) {
  return downloadTexels<Vec3f>(context, atlas, copy, [&](const uint32_t* words) {
    return unpackIrradiance(atlas.format, words);
  });
}

uint32_t uploadIrradiance(GpuContext& context, ProbeAtlas& atlas, int copy,
                          std::span<const Vec3f> texels) {
  PROBELAB_CHECK_EQ(texels.size(), atlas.probes * atlas.side() * atlas.side());
  const uint32_t words = wordsOf(atlas);
  std::vector<uint32_t> stored(texels.size() * words);
  uint32_t clamped = 0;
  for (std::size_t i = 0; i < texels.size(); ++i) {
    packIrradiance(atlas.format, texels[i], &stored[i * words]);
    if (maxComponent(texels[i]) > largestIrradiance(atlas.format)) ++clamped;
  }
  uploadArray(context, atlas.copies[static_cast<std::size_t>(copy)], stored);
  return clamped;
}

std::vector<Vec2f> downloadMoments(GpuContext& context, const ProbeAtlas& atlas, int copy) {
  return downloadTexels<Vec2f>(context, atlas, copy, [&](const uint32_t* words) {
    return unpackMoments(atlas.format, atlas.encoding, words);
  });
}

Defines atlasDefines(const Params& params) {
  return {{"PL_IRRADIANCE_FORMAT", std::to_string(params.irradiance_format)},
          {"PL_MOMENT_FORMAT", std::to_string(params.moment_format)},
          {"PL_MOMENT_ENCODING", std::to_string(params.moment_encoding)},
          {"PL_BORDER", std::to_string(params.border)}};
}

}  // namespace probelab
