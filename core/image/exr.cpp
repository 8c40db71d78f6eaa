// SPDX-License-Identifier: Apache-2.0
// The header is read and judged by OpenEXR's C library first: it allocates nothing that a header
// claims. Only a file that passes reaches the C++ reader, which decodes a few lines at a time.
#include "image/exr.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/openexr.h>

#include <algorithm>
#include <array>
#include <memory>

#include "base/error.h"
#include "base/files.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

constexpr int kMaxSide = 1 << 16;
constexpr int64_t kMaxPixelBytes = int64_t{1} << 31;
// The codecs work on up to 256 lines at once, so this bounds their buffers at 2 GiB.
constexpr int64_t kMaxLineBytes = int64_t{1} << 23;
constexpr int64_t kMaxTileRowBytes = int64_t{1} << 29;
constexpr int kLinesAtOnce = 64;

struct FullName {
  std::string layer, channel;
};

FullName splitName(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string::npos) return {"", name};
  return {name.substr(0, dot), name.substr(dot + 1)};
}

std::string joinName(const std::string& layer, const std::string& channel) {
  return layer.empty() ? channel : layer + "." + channel;
}

// R, G, B, A first, the others by name.
bool channelBefore(const std::string& a, const std::string& b) {
  static constexpr std::array<std::string_view, 4> kFirst = {"R", "G", "B", "A"};
  const auto rank = [&](const std::string& s) {
    return std::find(kFirst.begin(), kFirst.end(), s) - kFirst.begin();
  };
  return std::pair(rank(a), a) < std::pair(rank(b), b);
}

void keepFirstMessage(exr_const_context_t context, exr_result_t, const char* message) {
  void* user = nullptr;
  if (exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || !user) return;
  auto* text = static_cast<std::string*>(user);
  if (text->empty()) *text = message;
}

struct ContextCloser {
  void operator()(_priv_exr_context_t* context) const { exr_finish(&context); }
};

void checkChannels(exr_context_t file, const std::string& name, int64_t width, int64_t height) {
  const exr_attr_chlist_t* channels = nullptr;
  if (exr_get_channels(file, 0, &channels) != EXR_ERR_SUCCESS || channels->num_channels < 1)
    throwInput("{}: has no channels", name);
  for (int c = 0; c < channels->num_channels; ++c)
    if (channels->entries[c].x_sampling != 1 || channels->entries[c].y_sampling != 1)
      throwInput("{}: channel {} is subsampled, which is not supported; save it at full size", name,
                 channels->entries[c].name.str);
  const int64_t line_bytes = width * channels->num_channels * int64_t{sizeof(float)};
  if (line_bytes > kMaxLineBytes || line_bytes * height > kMaxPixelBytes)
    throwInput("{}: {} x {} pixels of {} channels are too large (at most 2 GiB, 8 MiB a line)",
               name, width, height, channels->num_channels);
}

void checkTiles(exr_context_t file, const std::string& name, int64_t width) {
  uint32_t tile_width = 0, tile_height = 0;
  exr_tile_level_mode_t levels;
  exr_tile_round_mode_t rounding;
  if (exr_get_tile_descriptor(file, 0, &tile_width, &tile_height, &levels, &rounding) !=
      EXR_ERR_SUCCESS)
    throwInput("{}: is damaged: its tiles are not described", name);
  const exr_attr_chlist_t* channels = nullptr;
  exr_get_channels(file, 0, &channels);
  const int64_t row_bytes = (width + int64_t{tile_width}) * channels->num_channels * 4;
  if (tile_width == 0 || tile_height == 0 || tile_width > kMaxSide || tile_height > kMaxSide ||
      row_bytes * tile_height > kMaxTileRowBytes)
    throwInput("{}: tiles of {} x {} pixels are too large", name, tile_width, tile_height);
}

void checkHeader(const fs::path& path) {
  const std::string name = path.string();
  std::string message;
  exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
  settings.error_handler_fn = keepFirstMessage;
  settings.user_data = &message;
  exr_context_t opened = nullptr;
  const exr_result_t result = exr_start_read(&opened, name.c_str(), &settings);
  const std::unique_ptr<_priv_exr_context_t, ContextCloser> file(opened);
  if (result != EXR_ERR_SUCCESS)
    throwInput("{}: is not a readable EXR file: {}", name,
               message.empty() ? exr_get_default_error_message(result) : message);
  int parts = 0;
  exr_get_count(opened, &parts);
  exr_storage_t storage{};
  if (parts != 1) throwInput("{}: has {} parts, one is needed", name, parts);
  if (exr_get_storage(opened, 0, &storage) != EXR_ERR_SUCCESS ||
      (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED))
    throwInput("{}: holds deep data, which is not supported", name);
  exr_attr_box2i_t window{};
  if (exr_get_data_window(opened, 0, &window) != EXR_ERR_SUCCESS)
    throwInput("{}: is damaged: it has no data window", name);
  const int64_t width = int64_t{window.max.x} - window.min.x + 1;
  const int64_t height = int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide)
    throwInput("{}: a data window of {} x {} pixels is out of range (1 to {})", name, width, height,
               kMaxSide);
  checkChannels(opened, name, width, height);
  if (storage == EXR_STORAGE_TILED) checkTiles(opened, name, width);
}

ImageFile describe(const Imf::Header& header) {
  ImageFile file;
  const Imath::Box2i window = header.dataWindow();
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    const FullName full = splitName(c.name());
    Image& layer = file.layers[full.layer];
    layer.width = window.max.x - window.min.x + 1;
    layer.height = window.max.y - window.min.y + 1;
    layer.channels.push_back(full.channel);
  }
  for (auto& [name, layer] : file.layers)
    std::sort(layer.channels.begin(), layer.channels.end(), channelBefore);
  for (auto a = header.begin(); a != header.end(); ++a)
    if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&a.attribute()))
      file.attributes[a.name()] = text->value();
  return file;
}

// Where one channel's value lies, as OpenEXR addresses pixels: base + x * stride + y * stride.
Imf::Slice sliceOf(float* first_pixel, std::size_t channels, const Imath::V2i& origin, int width) {
  return Imf::Slice::Make(Imf::FLOAT, first_pixel, origin, width, 1, channels * sizeof(float),
                          channels * static_cast<std::size_t>(width) * sizeof(float));
}

void readLines(Imf::InputFile& input, ImageFile& file, int first, int last) {
  const Imath::V2i corner = input.header().dataWindow().min;
  Imf::FrameBuffer frame;
  for (auto& [name, layer] : file.layers) {
    const std::size_t line = layer.channels.size() * static_cast<std::size_t>(layer.width);
    const std::size_t done = layer.data.size();
    layer.data.resize(done + line * static_cast<std::size_t>(last - first + 1));
    for (std::size_t c = 0; c < layer.channels.size(); ++c)
      frame.insert(joinName(name, layer.channels[c]),
                   sliceOf(layer.data.data() + done + c, layer.channels.size(), {corner.x, first},
                           layer.width));
  }
  input.setFrameBuffer(frame);
  input.readPixels(first, last);
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
      header.channels().insert(joinName(layer_name, channel), Imf::Channel(Imf::FLOAT));
  }
  for (const auto& [key, value] : file.attributes) {
    if (header.find(key) != header.end())
      throwInput("{}: attribute '{}' is EXR's own; choose another name", name, key);
    header.insert(key, Imf::StringAttribute(value));
  }
  return header;
}

}  // namespace

ImageFile readExr(const fs::path& path) {
  std::error_code ec;
  if (!fs::exists(path, ec)) throwInput("{}: no such file", path.string());
  if (fs::is_directory(path, ec)) throwInput("{}: is a folder, a file is needed", path.string());
  checkHeader(path);
  try {
    Imf::InputFile input(path.c_str());
    const Imath::Box2i window = input.header().dataWindow();
    ImageFile file = describe(input.header());
    for (int y = window.min.y; y <= window.max.y; y += kLinesAtOnce)
      readLines(input, file, y, std::min(y + kLinesAtOnce - 1, window.max.y));
    return file;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    throwInput("{}: is damaged: {}", path.string(), e.what());
  }
}

void writeExr(const fs::path& path, const ImageFile& file) {
  const Imf::Header header = headerFor(file, path.string());
  writeFileAtomically(path, [&](const fs::path& temporary) {
    try {
      Imf::OutputFile output(temporary.c_str(), header);
      Imf::FrameBuffer frame;
      for (const auto& [name, layer] : file.layers)
        for (std::size_t c = 0; c < layer.channels.size(); ++c)
          frame.insert(joinName(name, layer.channels[c]),
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
