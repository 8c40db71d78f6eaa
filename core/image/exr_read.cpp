// SPDX-License-Identifier: Apache-2.0
// Reading through OpenEXR's C library, which allocates nothing that a header claims and, unlike the
// C++ one, refuses chunks that decode to fewer bytes than they should. The header is judged first;
// then memory grows chunk by chunk.
#include <OpenEXR/openexr.h>

#include <algorithm>
#include <array>
#include <utility>

#include "base/error.h"
#include "exr_names.h"
#include "image/exr.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

constexpr int kMaxSide = 1 << 16;
constexpr int64_t kMaxPixelBytes = int64_t{1} << 31;
// Codecs work on up to 256 lines at once, so this bounds their buffers at 2 GiB.
constexpr int64_t kMaxLineBytes = int64_t{1} << 23;
// No codec but DWA packs more tightly than deflate's 1,032 (four thirds of it for PXR24); DWA keeps
// one number of a block of 64 through deflate. The library takes memory for what a chunk claims.
constexpr uint64_t kMostPacking = 64 * 1032;
constexpr int64_t kMaxTileRowBytes = int64_t{1} << 29;

void keepFirstMessage(exr_const_context_t context, exr_result_t, const char* message) {
  void* user = nullptr;
  if (exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || !user) return;
  auto* text = static_cast<std::string*>(user);
  if (text->empty()) *text = message;
}

// An open file; every failing call becomes an InputError that names it.
class ExrInput {
 public:
  explicit ExrInput(const fs::path& path) : name_(path.string()) {
    exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
    settings.error_handler_fn = keepFirstMessage;
    settings.user_data = &message_;
    const exr_result_t result = exr_start_read(&context_, name_.c_str(), &settings);
    if (result == EXR_ERR_SUCCESS) return;
    exr_finish(&context_);
    throwInput("{}: is not a readable EXR file: {}", name_, reason(result));
  }
  ~ExrInput() { exr_finish(&context_); }
  ExrInput(const ExrInput&) = delete;
  ExrInput& operator=(const ExrInput&) = delete;

  void require(exr_result_t result) const {
    if (result != EXR_ERR_SUCCESS) throwInput("{}: is damaged: {}", name_, reason(result));
  }
  exr_context_t context() const { return context_; }
  const std::string& name() const { return name_; }

 private:
  std::string reason(exr_result_t result) const {
    return message_.empty() ? exr_get_default_error_message(result) : message_;
  }

  std::string name_;
  std::string message_;
  exr_context_t context_ = nullptr;
};

struct Layout {
  int min_x = 0, min_y = 0, width = 0, height = 0;
  bool tiled = false;
};

void checkChannels(const ExrInput& file, const Layout& layout) {
  const exr_attr_chlist_t* channels = nullptr;
  file.require(exr_get_channels(file.context(), 0, &channels));
  if (channels->num_channels < 1) throwInput("{}: has no channels", file.name());
  for (int c = 0; c < channels->num_channels; ++c)
    if (channels->entries[c].x_sampling != 1 || channels->entries[c].y_sampling != 1)
      throwInput("{}: channel {} is subsampled, which is not supported; save it at full size",
                 file.name(), channels->entries[c].name.str);
  const int64_t line_bytes = int64_t{layout.width} * channels->num_channels * 4;
  if (line_bytes > kMaxLineBytes || line_bytes * layout.height > kMaxPixelBytes)
    throwInput("{}: {} x {} pixels of {} channels are too large (at most 2 GiB, 8 MiB a line)",
               file.name(), layout.width, layout.height, channels->num_channels);
}

void checkTiles(const ExrInput& file, const Layout& layout) {
  uint32_t width = 0, height = 0;
  exr_tile_level_mode_t levels;
  exr_tile_round_mode_t rounding;
  const exr_attr_chlist_t* channels = nullptr;
  file.require(exr_get_tile_descriptor(file.context(), 0, &width, &height, &levels, &rounding));
  file.require(exr_get_channels(file.context(), 0, &channels));
  const int64_t row_bytes = (int64_t{layout.width} + width) * channels->num_channels * 4;
  if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide ||
      row_bytes * height > kMaxTileRowBytes)
    throwInput("{}: tiles of {} x {} pixels are out of range", file.name(), width, height);
}

Layout checkHeader(const ExrInput& file) {
  int parts = 0;
  exr_storage_t storage{};
  exr_attr_box2i_t window{};
  file.require(exr_get_count(file.context(), &parts));
  if (parts != 1) throwInput("{}: has {} parts, one is needed", file.name(), parts);
  file.require(exr_get_storage(file.context(), 0, &storage));
  if (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED)
    throwInput("{}: holds deep data, which is not supported", file.name());
  file.require(exr_get_data_window(file.context(), 0, &window));
  const int64_t width = int64_t{window.max.x} - window.min.x + 1;
  const int64_t height = int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide)
    throwInput("{}: a data window of {} x {} pixels is out of range (1 to {})", file.name(), width,
               height, kMaxSide);
  const Layout layout{window.min.x, window.min.y, static_cast<int>(width), static_cast<int>(height),
                      storage == EXR_STORAGE_TILED};
  checkChannels(file, layout);
  if (layout.tiled) checkTiles(file, layout);
  return layout;
}

// R, G, B, A first, the others by name.
bool channelBefore(const std::string& a, const std::string& b) {
  static constexpr std::array<std::string_view, 4> kFirst = {"R", "G", "B", "A"};
  const auto rank = [&](const std::string& s) {
    return std::find(kFirst.begin(), kFirst.end(), s) - kFirst.begin();
  };
  return std::pair(rank(a), a) < std::pair(rank(b), b);
}

// Layers without pixels yet, and the string attributes.
ImageFile describe(const ExrInput& input, const Layout& layout) {
  ImageFile file;
  const exr_attr_chlist_t* channels = nullptr;
  input.require(exr_get_channels(input.context(), 0, &channels));
  for (int c = 0; c < channels->num_channels; ++c) {
    const ExrChannelName full = splitExrName(channels->entries[c].name.str);
    Image& layer = file.layers[full.layer];
    layer.width = layout.width, layer.height = layout.height;
    layer.channels.push_back(full.channel);
  }
  for (auto& [name, layer] : file.layers)
    std::sort(layer.channels.begin(), layer.channels.end(), channelBefore);
  int32_t count = 0;
  input.require(exr_get_attribute_count(input.context(), 0, &count));
  for (int32_t i = 0; i < count; ++i) {
    const exr_attribute_t* attribute = nullptr;
    input.require(
        exr_get_attribute_by_index(input.context(), 0, EXR_ATTR_LIST_FILE_ORDER, i, &attribute));
    if (attribute->type == EXR_ATTR_STRING)
      file.attributes[attribute->name] =
          std::string(attribute->string->str, static_cast<std::size_t>(attribute->string->length));
  }
  return file;
}

// Decodes chunks into the layers' pixels as 32-bit floats.
class ChunkDecoder {
 public:
  ChunkDecoder(const ExrInput& input, ImageFile& file) : input_(input), file_(file) {}
  ~ChunkDecoder() { exr_decoding_destroy(input_.context(), &pipeline_); }
  ChunkDecoder(const ChunkDecoder&) = delete;
  ChunkDecoder& operator=(const ChunkDecoder&) = delete;

  // The chunk's top left pixel goes to (x, y); the layers hold these lines already.
  void decode(const exr_chunk_info_t& chunk, int x, int y) {
    if (chunk.unpacked_size / kMostPacking > chunk.packed_size)
      throwInput("{}: is damaged: {} bytes cannot hold {}", input_.name(), chunk.packed_size,
                 chunk.unpacked_size);
    if (ready_) {
      input_.require(exr_decoding_update(input_.context(), 0, &chunk, &pipeline_));
    } else {
      input_.require(exr_decoding_initialize(input_.context(), 0, &chunk, &pipeline_));
    }
    for (int c = 0; c < pipeline_.channel_count; ++c) aim(pipeline_.channels[c], x, y);
    if (!std::exchange(ready_, true))
      input_.require(exr_decoding_choose_default_routines(input_.context(), 0, &pipeline_));
    input_.require(exr_decoding_run(input_.context(), 0, &pipeline_));
  }

 private:
  void aim(exr_coding_channel_info_t& channel, int x, int y) {
    const ExrChannelName full = splitExrName(channel.channel_name);
    Image& layer = file_.layers.at(full.layer);
    const auto index = static_cast<std::size_t>(channelIndex(layer, full.channel));
    channel.decode_to_ptr = reinterpret_cast<uint8_t*>(&layer.at(x, y, index));
    channel.user_bytes_per_element = sizeof(float);
    channel.user_data_type = EXR_PIXEL_FLOAT;
    channel.user_pixel_stride = static_cast<int32_t>(layer.channels.size() * sizeof(float));
    channel.user_line_stride = channel.user_pixel_stride * layer.width;
  }

  const ExrInput& input_;
  ImageFile& file_;
  exr_decode_pipeline_t pipeline_ = EXR_DECODE_PIPELINE_INITIALIZER;
  bool ready_ = false;
};

void growToLines(ImageFile& file, int lines) {
  for (auto& [name, layer] : file.layers)
    layer.data.resize(static_cast<std::size_t>(lines) * static_cast<std::size_t>(layer.width) *
                      layer.channels.size());
}

void readScanLines(const ExrInput& input, const Layout& layout, ImageFile& file) {
  int32_t step = 0;
  input.require(exr_get_scanlines_per_chunk(input.context(), 0, &step));
  if (step < 1) throwInput("{}: is damaged: its compression is unknown", input.name());
  ChunkDecoder decoder(input, file);
  for (int y = 0; y < layout.height; y += step) {
    exr_chunk_info_t chunk{};
    input.require(exr_read_scanline_chunk_info(input.context(), 0, layout.min_y + y, &chunk));
    growToLines(file, std::min(y + step, layout.height));
    decoder.decode(chunk, 0, y);
  }
}

void readTiles(const ExrInput& input, const Layout& layout, ImageFile& file) {
  int32_t width = 0, height = 0;
  input.require(exr_get_tile_sizes(input.context(), 0, 0, 0, &width, &height));
  if (width < 1 || height < 1) throwInput("{}: is damaged: its tiles have no size", input.name());
  ChunkDecoder decoder(input, file);
  for (int y = 0; y < layout.height; y += height) {
    growToLines(file, std::min(y + height, layout.height));
    for (int x = 0; x < layout.width; x += width) {
      exr_chunk_info_t chunk{};
      input.require(
          exr_read_tile_chunk_info(input.context(), 0, x / width, y / height, 0, 0, &chunk));
      decoder.decode(chunk, x, y);
    }
  }
}

}  // namespace

ImageFile readExr(const fs::path& path) {
  std::error_code ec;
  if (!fs::exists(path, ec)) throwInput("{}: no such file", path.string());
  if (fs::is_directory(path, ec)) throwInput("{}: is a folder, a file is needed", path.string());
  const ExrInput input(path);
  const Layout layout = checkHeader(input);
  ImageFile file = describe(input, layout);
  if (layout.tiled)
    readTiles(input, layout, file);
  else
    readScanLines(input, layout, file);
  return file;
}

}  // namespace probelab
