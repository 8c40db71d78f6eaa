// SPDX-License-Identifier: Apache-2.0
#include "image_decode.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <memory>

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 16384
// Zeroed: stb_image until 2.28 decodes with Huffman tables that the file may not have defined.
#define STBI_MALLOC(size) std::calloc(1, size)
#define STBI_REALLOC(memory, size) std::realloc(memory, size)
#define STBI_FREE(memory) std::free(memory)
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#include <stb_image.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

namespace probelab {
namespace {

// Deflate packs at most 1,032 bytes into one (runs of 258 at two bits each).
constexpr uint64_t kDeflateRatio = 1032;
// A JPEG spends at least a bit on each 8 x 8 block.
constexpr uint64_t kJpegTexelsPerByte = 8 * 8 * 8;

// At least so many bits has a texel of a PNG, by its first chunk: bits a channel and colour type.
uint64_t pngBitsPerTexel(std::span<const uint8_t> bytes) {
  constexpr uint8_t kHeader[] = {'I', 'H', 'D', 'R'};
  if (bytes.size() < 26 || !std::equal(std::begin(kHeader), std::end(kHeader), bytes.begin() + 12))
    return 1;
  const uint8_t kind = bytes[25];
  return bytes[24] * uint64_t{kind == 2 ? 3u : kind == 4 ? 2u : kind == 6 ? 4u : 1u};
}

// Whether each chunk of a PNG ends before the file does: the decoder takes memory for what a chunk
// claims.
bool hasWholeChunks(std::span<const uint8_t> bytes) {
  constexpr uint8_t kEnd[] = {'I', 'E', 'N', 'D'};
  constexpr std::size_t kAround = 12;  // length and name before the data, a checksum behind
  for (std::size_t at = 8; at + 8 <= bytes.size();) {
    if (std::equal(std::begin(kEnd), std::end(kEnd), bytes.begin() + at + 4)) return true;
    uint64_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = length << 8 | bytes[at + i];
    if (length + kAround > bytes.size() - at) return false;
    at += kAround + length;
  }
  return true;
}

uint64_t byteAt(std::span<const uint8_t> bytes, std::size_t at) {
  return at < bytes.size() ? bytes[at] : 0;  // as the decoder reads beyond the end
}

// Where a segment of Huffman tables ends, its length standing at `at`; 0 when a table has more than
// 255 codes (JPEG has a use for 176): the decoder, stb_image until 2.28, writes beyond its array
// from 257 on, and takes code 255 for a mark of its own.
std::size_t endOfTables(std::span<const uint8_t> bytes, std::size_t at) {
  const auto length = static_cast<int64_t>(byteAt(bytes, at) << 8 | byteAt(bytes, at + 1));
  at += 2;
  for (int64_t left = length - 2; left > 0;) {
    uint64_t codes = 0;
    for (std::size_t i = 1; i <= 16; ++i) codes += byteAt(bytes, at + i);
    if (codes > 255) return 0;
    at += 17 + codes;
    left -= static_cast<int64_t>(17 + codes);
  }
  return at;
}

// Goes through a JPEG as the decoder does: segments by their length up to the first scan, then from
// one marker to the next wherever it stands.
bool hasSoundTables(std::span<const uint8_t> bytes) {
  constexpr uint8_t kTables = 0xc4, kStart = 0xd8, kScan = 0xda;
  bool in_scan = false;
  for (std::size_t at = 0; at < bytes.size();) {
    while (at < bytes.size() && bytes[at] != 0xff) ++at;
    while (at < bytes.size() && bytes[at] == 0xff) ++at;
    if (at >= bytes.size()) return true;
    const uint8_t marker = bytes[at++];
    if (marker == kTables) {
      at = endOfTables(bytes, at);
      if (at == 0) return false;
    } else if (marker == kScan) {
      in_scan = true;
    } else if (!in_scan && marker != kStart) {
      at += std::max<uint64_t>(2, byteAt(bytes, at) << 8 | byteAt(bytes, at + 1));
    }
  }
  return true;
}

// Whether so few bytes can hold so large a picture: the decoder takes memory for what a header
// claims, and goes on where a JPEG ends early.
bool canHold(std::span<const uint8_t> bytes) {
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                             &channels))
    return true;  // the decoder says why not
  const uint64_t texels = static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
  if (bytes[0] == 0x89)  // a PNG; a JPEG begins with 0xff
    return texels * pngBitsPerTexel(bytes) / 8 / kDeflateRatio <= bytes.size();
  return texels / kJpegTexelsPerByte <= bytes.size();
}

}  // namespace

std::optional<Texture> decodeImage(std::span<const uint8_t> bytes, std::string& why) {
  if (bytes.empty() || bytes.size() > std::numeric_limits<int>::max()) {
    why = "no data";
    return std::nullopt;
  }
  if (bytes[0] == 0xff && !hasSoundTables(bytes)) {
    why = "it is damaged: a table of more than 255 codes";
    return std::nullopt;
  }
  if (bytes[0] == 0x89 && !hasWholeChunks(bytes)) {
    why = "truncated: a chunk ends after the file";
    return std::nullopt;
  }
  if (!canHold(bytes)) {
    why = "truncated: it has fewer bytes than its size in texels needs";
    return std::nullopt;
  }
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                            &channels, 4),
      stbi_image_free);
  if (!pixels) {
    const char* reason = stbi_failure_reason();  // may begin with a byte 0 of the file
    why = reason != nullptr && *reason != '\0' ? reason : "it is damaged";
    return std::nullopt;
  }
  Texture texture;
  texture.width = width;
  texture.height = height;
  const std::size_t size = std::size_t{4} * width * height;
  texture.rgba.assign(pixels.get(), pixels.get() + size);
  return texture;
}

}  // namespace probelab
