// SPDX-License-Identifier: Apache-2.0
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>

#include "base/error.h"
#include "base/files.h"
#include "exr_names.h"
#include "image/exr.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

// Where one channel's value lies, as OpenEXR addresses pixels: base + x * stride + y * stride.
Imf::Slice sliceOf(float* first_pixel, std::size_t channels, const Imath::V2i& origin, int width) {
  return Imf::Slice::Make(Imf::FLOAT, first_pixel, origin, width, 1, channels * sizeof(float),
                          channels * static_cast<std::size_t>(width) * sizeof(float));
}

Imf::Header headerFor(const ImageFile& file, const std::string& name) {
  PROBELAB_CHECK(!file.layers.empty());
  const Image& any = file.layers.begin()->second;
  Imf::Header header(any.width, any.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const auto& [layer_name, layer] : file.layers) {
    PROBELAB_CHECK_EQ(layer.width, any.width);
    PROBELAB_CHECK_EQ(layer.height, any.height);
    PROBELAB_CHECK_EQ(layer.data.size(), layer.pixelCount() * layer.channels.size());
    PROBELAB_CHECK(!layer.channels.empty());
    for (const std::string& channel : layer.channels)
      header.channels().insert(joinExrName(layer_name, channel), Imf::Channel(Imf::FLOAT));
  }
  for (const auto& [key, value] : file.attributes) {
    if (header.find(key) != header.end())
      throwInput("{}: attribute '{}' is EXR's own; choose another name", name, key);
    header.insert(key, Imf::StringAttribute(value));
  }
  return header;
}

}  // namespace

void writeExr(const fs::path& path, const ImageFile& file) {
  const Imf::Header header = headerFor(file, path.string());
  writeFileAtomically(path, [&](const fs::path& temporary) {
    try {
      Imf::OutputFile output(temporary.c_str(), header);
      Imf::FrameBuffer frame;
      for (const auto& [name, layer] : file.layers)
        for (std::size_t c = 0; c < layer.channels.size(); ++c)
          frame.insert(joinExrName(name, layer.channels[c]),
                       sliceOf(const_cast<float*>(layer.data.data()) + c, layer.channels.size(),
                               {0, 0}, layer.width));
      output.setFrameBuffer(frame);
      output.writePixels(file.layers.begin()->second.height);
    } catch (const std::exception& e) {
      throw Error(fmt::format("{}: cannot be written: {}", path.string(), e.what()));
    }
  });
}

}  // namespace probelab
