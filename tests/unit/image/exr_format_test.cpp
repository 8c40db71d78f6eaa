// SPDX-License-Identifier: GPL-3.0-or-later
// EXR files put together byte by byte from the format's specification, without OpenEXR: pixel
// types, tiles, and what is refused.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "image/exr.h"

namespace probelab {
namespace {
namespace fs = std::filesystem;

std::string text(const std::string& s) { return s + '\0'; }

template <class T>
std::string raw(T value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string attribute(const std::string& name, const std::string& type, const std::string& value) {
  return text(name) + text(type) + raw(int32_t(value.size())) + value;
}

enum PixelType : int32_t { kUint = 0, kHalf = 1, kFloat = 2 };

std::string channel(const std::string& name, PixelType type, int32_t sampling = 1) {
  return text(name) + raw(int32_t{type}) + raw(int32_t{0}) + raw(sampling) + raw(sampling);
}

std::string window(int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
  return raw(x0) + raw(y0) + raw(x1) + raw(y1);
}

// Magic, version flags and an uncompressed header with the given channels and data window.
std::string header(const std::string& channels, const std::string& data_window, int32_t flags = 0,
                   const std::string& more = "") {
  return raw(int32_t{20000630}) + raw(int32_t{2} | flags) +
         attribute("channels", "chlist", channels + '\0') +
         attribute("compression", "compression", std::string(1, '\0')) +
         attribute("dataWindow", "box2i", data_window) +
         attribute("displayWindow", "box2i", data_window) +
         attribute("lineOrder", "lineOrder", std::string(1, '\0')) +
         attribute("pixelAspectRatio", "float", raw(1.0f)) +
         attribute("screenWindowCenter", "v2f", raw(0.0f) + raw(0.0f)) +
         attribute("screenWindowWidth", "float", raw(1.0f)) + more + '\0';
}

// The offset table and the chunks behind the header.
std::string withChunks(std::string file, const std::vector<std::string>& chunks) {
  uint64_t offset = file.size() + 8 * chunks.size();
  std::string body;
  for (const std::string& chunk : chunks) {
    file += raw(offset);
    offset += chunk.size();
    body += chunk;
  }
  return file + body;
}

ImageFile readBytes(const std::string& bytes) {
  const fs::path path =
      fs::path(::testing::TempDir()) / ("format_" + std::to_string(getpid()) + ".exr");
  std::ofstream(path, std::ios::binary) << bytes;
  struct Remover {
    fs::path path;
    ~Remover() { fs::remove(path); }
  } remover{path};
  return readExr(path);
}

TEST(ExrFormat, ReadsEveryPixelTypeAtAnyOrigin) {
  // 2 x 2 pixels at (-3, 5); channels A half, Z float, id uint; halves 0x3c00 = 1, 0xc100 = -2.5.
  const std::string channels =
      channel("A", kHalf) + channel("depth.Z", kFloat) + channel("id", kUint);
  const auto line = [](int32_t y, uint16_t h0, uint16_t h1, float z0, float z1, uint32_t i0,
                       uint32_t i1) {
    return raw(y) + raw(int32_t{20}) + raw(h0) + raw(h1) + raw(z0) + raw(z1) + raw(i0) + raw(i1);
  };
  const ImageFile file = readBytes(
      withChunks(header(channels, window(-3, 5, -2, 6), 0, attribute("note", "string", "hello")),
                 {line(5, 0x3c00, 0xc100, 0.1f, 1e9f, 7, 70000), line(6, 0, 0x3c00, 3, 4, 0, 1)}));
  EXPECT_EQ(file.attributes.at("note"), "hello");
  const Image& main = file.layers.at("");
  EXPECT_EQ(main.channels, (std::vector<std::string>{"A", "id"}));
  EXPECT_EQ(main.data, (std::vector<float>{1, 7, -2.5f, 70000, 0, 0, 1, 1}));
  EXPECT_EQ(file.layers.at("depth").data, (std::vector<float>{0.1f, 1e9f, 3, 4}));
}

TEST(ExrFormat, ReadsTilesThatStandOverTheEdge) {
  // 3 x 3 pixels in tiles of 2 x 2; the value is 10 y + x.
  constexpr int32_t kTiled = 0x200;
  std::vector<std::string> tiles;
  for (int32_t ty = 0; ty < 2; ++ty)
    for (int32_t tx = 0; tx < 2; ++tx) {
      std::string data;
      for (int y = 2 * ty; y < std::min(2 * ty + 2, 3); ++y)
        for (int x = 2 * tx; x < std::min(2 * tx + 2, 3); ++x) data += raw(float(10 * y + x));
      tiles.push_back(raw(tx) + raw(ty) + raw(int32_t{0}) + raw(int32_t{0}) +
                      raw(int32_t(data.size())) + data);
    }
  const auto tiledesc = [](uint32_t w, uint32_t h) {
    return attribute("tiles", "tiledesc", raw(w) + raw(h) + '\0');
  };
  const ImageFile file = readBytes(
      withChunks(header(channel("Y", kFloat), window(0, 0, 2, 2), kTiled, tiledesc(2, 2)), tiles));
  EXPECT_EQ(file.layers.at("").data, (std::vector<float>{0, 1, 2, 10, 11, 12, 20, 21, 22}));
  for (const uint32_t bad : {0u, 0x40000000u, 0x7fffffffu, 0xffffffffu})
    EXPECT_THROW(
        readBytes(withChunks(
            header(channel("Y", kFloat), window(0, 0, 2, 2), kTiled, tiledesc(bad, bad)), tiles)),
        InputError);
}

TEST(ExrFormat, RefusesWhatItCannotRead) {
  const std::string one = raw(int32_t{0}) + raw(int32_t{4}) + raw(1.0f);
  const auto read = [&](const std::string& channels, const std::string& data_window,
                        int32_t flags) {
    return readBytes(withChunks(header(channels, data_window, flags), {one}));
  };
  const std::string y = channel("Y", kFloat), pixel = window(0, 0, 0, 0);
  EXPECT_EQ(read(y, pixel, 0).layers.at("").data, std::vector<float>{1});
  EXPECT_THROW(read("", pixel, 0), InputError);                       // no channels
  EXPECT_THROW(read(channel("Y", kFloat, 2), pixel, 0), InputError);  // subsampled
  EXPECT_THROW(read(channel("Y", PixelType(9)), pixel, 0), InputError);
  EXPECT_THROW(read(y, pixel, 0x800), InputError);           // deep
  EXPECT_THROW(read(y, pixel, 0x1000), InputError);          // several parts
  EXPECT_THROW(read(y, window(0, 0, 0, 1), 0), InputError);  // a line is missing
  EXPECT_THROW(read(y, window(0, 0, 1, 0), 0), InputError);  // a line is too short
  EXPECT_THROW(read(y, window(0, 0, 65535, 65535), 0), InputError);
  EXPECT_THROW(read(y, window(1, 1, 0, 0), 0), InputError);
}

TEST(ExrFormat, WritesTheMagicNumberAndChannelNames) {
  const fs::path path =
      fs::path(::testing::TempDir()) / ("written_" + std::to_string(getpid()) + ".exr");
  ImageFile file;
  file.layers["direct"] = makeImage(1, 1, {"R", "G", "B"});
  writeExr(path, file);
  std::ifstream in(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  fs::remove(path);
  EXPECT_EQ(bytes.substr(0, 8), raw(int32_t{20000630}) + raw(int32_t{2}));
  // Channels in the file stand in alphabetical order, each float (2).
  const std::string list = channel("direct.B", kFloat) + channel("direct.G", kFloat) +
                           channel("direct.R", kFloat) + '\0';
  EXPECT_NE(bytes.find(attribute("channels", "chlist", list)), std::string::npos);
  EXPECT_NE(bytes.find(attribute("compression", "compression", "\x03")), std::string::npos);  // ZIP
}

}  // namespace
}  // namespace probelab
