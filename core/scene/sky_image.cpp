// SPDX-License-Identifier: Apache-2.0
// Through OpenEXR's C library: it refuses chunks that decode short, which the C++ one does not.
#include "sky_image.h"

#include <OpenEXR/openexr.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "warnings.h"

namespace probelab {
namespace {

constexpr int64_t kMaxSide = 16384;
// No codec but DWA packs more tightly than deflate's 1,032 (four thirds of it for PXR24); DWA keeps
// one number of a block of 64 through deflate. The library takes memory for what a chunk claims.
constexpr uint64_t kMostPacking = 64 * 1032;

// What was hashed is what is decoded: the library reads from memory.
struct Source {
  std::span<const std::byte> bytes;
  std::string message;  // the first that the library has to say
};

Source& sourceOf(void* user) { return *static_cast<Source*>(user); }

int64_t readBytes(exr_const_context_t, void* user, void* out, uint64_t size, uint64_t offset,
                  exr_stream_error_func_ptr_t) {
  const std::span<const std::byte> bytes = sourceOf(user).bytes;
  if (offset > bytes.size()) return 0;
  const std::size_t n = std::min<std::size_t>(size, bytes.size() - offset);
  if (n > 0) std::memcpy(out, bytes.data() + offset, n);
  return static_cast<int64_t>(n);
}

int64_t countBytes(exr_const_context_t, void* user) {
  return static_cast<int64_t>(sourceOf(user).bytes.size());
}

void keepMessage(exr_const_context_t context, exr_result_t, const char* message) {
  void* user = nullptr;
  if (exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || user == nullptr) return;
  if (sourceOf(user).message.empty()) sourceOf(user).message = message;
}

class ExrReader {
 public:
  ExrReader(std::string file, std::span<const std::byte> bytes)
      : file_(std::move(file)), source_{bytes, {}} {
    exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
    settings.user_data = &source_;
    settings.read_fn = readBytes;
    settings.size_fn = countBytes;
    settings.error_handler_fn = keepMessage;
    const exr_result_t result = exr_start_read(&context_, file_.c_str(), &settings);
    if (result == EXR_ERR_SUCCESS) return;
    exr_finish(&context_);
    require(result);
  }
  ~ExrReader() {
    exr_decoding_destroy(context_, &pipeline_);
    exr_finish(&context_);
  }
  ExrReader(const ExrReader&) = delete;
  ExrReader& operator=(const ExrReader&) = delete;

  void read(Sky& sky);

 private:
  void require(exr_result_t result) const {
    if (result == EXR_ERR_SUCCESS) return;
    const std::string& said = source_.message;
    throwInput("{}: cannot be read as an EXR image: {}", file_,
               printable(said.empty() ? exr_get_default_error_message(result) : said));
  }
  exr_attr_box2i_t checkHeader();
  void checkChannels();
  void decode(const exr_chunk_info_t& chunk, Sky& sky, int line);

  std::string file_;
  Source source_;
  exr_context_t context_ = nullptr;
  exr_decode_pipeline_t pipeline_ = EXR_DECODE_PIPELINE_INITIALIZER;
  bool gray_ = false, ready_ = false;
};

exr_attr_box2i_t ExrReader::checkHeader() {
  int parts = 0;
  exr_storage_t storage{};
  exr_attr_box2i_t window{};
  require(exr_get_count(context_, &parts));
  require(exr_get_storage(context_, 0, &storage));
  if (parts != 1 || storage != EXR_STORAGE_SCANLINE)
    throwInput("{}: is tiled, deep or has several parts; save it as one image of scan lines",
               file_);
  require(exr_get_data_window(context_, 0, &window));
  const int64_t width = int64_t{window.max.x} - window.min.x + 1;
  const int64_t height = int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide)
    throwInput("{}: is {} x {} texels, 1 to {} a side are read", file_, width, height, kMaxSide);
  checkChannels();
  return window;
}

void ExrReader::checkChannels() {
  const exr_attr_chlist_t* list = nullptr;
  require(exr_get_channels(context_, 0, &list));
  const auto has = [&](const char* name) {
    for (int c = 0; c < list->num_channels; ++c)
      if (std::strcmp(list->entries[c].name.str, name) == 0) return true;
    return false;
  };
  for (int c = 0; c < list->num_channels; ++c)
    if (list->entries[c].x_sampling != 1 || list->entries[c].y_sampling != 1)
      throwInput("{}: channel {} is subsampled; save it at full size", file_,
                 printable(list->entries[c].name.str));
  const bool rgb = has("R") && has("G") && has("B");
  gray_ = !rgb && has("Y");
  if (!rgb && !gray_) throwInput("{}: has neither channels R, G, B nor Y", file_);
  if (list->num_channels > 64) throwInput("{}: has {} channels", file_, list->num_channels);
}

void ExrReader::decode(const exr_chunk_info_t& chunk, Sky& sky, int line) {
  require(ready_ ? exr_decoding_update(context_, 0, &chunk, &pipeline_)
                 : exr_decoding_initialize(context_, 0, &chunk, &pipeline_));
  for (int c = 0; c < pipeline_.channel_count; ++c) {
    exr_coding_channel_info_t& channel = pipeline_.channels[c];
    const std::string_view name = channel.channel_name;
    const std::size_t component =
        gray_ ? (name == "Y" ? 0 : 3) : std::string_view("RGB").find(name);
    if (component > 2 || name.size() != 1) continue;  // left out: no place to decode to
    float* texels = &sky.image[static_cast<std::size_t>(line) * sky.width].x;
    channel.decode_to_ptr = reinterpret_cast<uint8_t*>(texels + component);
    channel.user_bytes_per_element = sizeof(float);
    channel.user_data_type = EXR_PIXEL_FLOAT;
    channel.user_pixel_stride = sizeof(Vec3f);
    channel.user_line_stride = static_cast<int32_t>(sizeof(Vec3f)) * sky.width;
  }
  if (!std::exchange(ready_, true))
    require(exr_decoding_choose_default_routines(context_, 0, &pipeline_));
  require(exr_decoding_run(context_, 0, &pipeline_));
}

void ExrReader::read(Sky& sky) {
  const exr_attr_box2i_t window = checkHeader();
  sky.width = window.max.x - window.min.x + 1;
  sky.height = window.max.y - window.min.y + 1;
  int32_t step = 0;
  require(exr_get_scanlines_per_chunk(context_, 0, &step));
  if (step < 1) throwInput("{}: is damaged: its compression is unknown", file_);
  for (int y = 0; y < sky.height; y += step) {
    exr_chunk_info_t chunk{};
    require(exr_read_scanline_chunk_info(context_, 0, window.min.y + y, &chunk));
    if (chunk.unpacked_size / kMostPacking > chunk.packed_size)
      throwInput("{}: is damaged: {} bytes cannot hold {}", file_, chunk.packed_size,
                 chunk.unpacked_size);
    // Memory grows with what the file delivers, not with what its header claims.
    sky.image.resize(static_cast<std::size_t>(std::min(y + step, sky.height)) * sky.width);
    decode(chunk, sky, y);
  }
  if (!gray_) return;
  for (Vec3f& texel : sky.image) texel = Vec3f(texel.x);
}

}  // namespace

void readSkyImage(const std::filesystem::path& path, Sky& sky, std::vector<std::string>& hashes) {
  const std::string file = path.string();
  const std::vector<std::byte> bytes = readFile(path);
  hashes.push_back(contentHash(bytes));
  ExrReader(file, bytes).read(sky);
  for (std::size_t i = 0; i < sky.image.size(); ++i)
    if (!isFinite(sky.image[i]) || minComponent(sky.image[i]) < 0)
      throwInput("{}: texel ({}, {}) is negative or not finite; a sky cannot be", file,
                 i % sky.width, i / sky.width);
}

}  // namespace probelab
