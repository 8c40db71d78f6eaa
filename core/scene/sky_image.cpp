// SPDX-License-Identifier: Apache-2.0
#include "sky_image.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>

#include <cstring>
#include <span>

#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "warnings.h"

namespace probelab {
namespace {

constexpr int kMaxSide = 16384;

// OpenEXR's view of bytes in memory: what was hashed is what is decoded.
class MemoryStream : public Imf::IStream {
 public:
  MemoryStream(const std::string& name, std::span<const std::byte> bytes)
      : Imf::IStream(name.c_str()), bytes_(bytes) {}

  bool read(char c[], int n) override {
    if (n < 0 || static_cast<std::size_t>(n) > bytes_.size() - at_)
      throw std::runtime_error("the file ends early");
    std::memcpy(c, bytes_.data() + at_, static_cast<std::size_t>(n));
    at_ += static_cast<std::size_t>(n);
    return at_ < bytes_.size();
  }
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t position) override {
    if (position > bytes_.size()) throw std::runtime_error("the file ends early");
    at_ = position;
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_ = 0;
};

void decode(const std::string& file, std::span<const std::byte> bytes, Sky& sky) {
  MemoryStream stream(file, bytes);
  Imf::InputFile input(stream);
  const Imath::Box2i window = input.header().dataWindow();
  const int64_t width = int64_t{window.max.x} - window.min.x + 1;
  const int64_t height = int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide)
    throwInput("{}: is {} x {} texels, up to {} a side are read", file, width, height, kMaxSide);
  const Imf::ChannelList& channels = input.header().channels();
  const bool rgb =
      channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B");
  if (!rgb && !channels.findChannel("Y"))
    throwInput("{}: has neither channels R, G, B nor Y", file);
  sky.width = static_cast<int>(width);
  sky.height = static_cast<int>(height);
  sky.image.assign(static_cast<std::size_t>(width * height), Vec3f());
  Imf::FrameBuffer frame;
  // OpenEXR addresses texels from the window's own origin, which need not be (0, 0).
  const auto slice = [&](std::size_t c) {
    return Imf::Slice::Make(Imf::FLOAT, &sky.image[0].x + c, window, sizeof(Vec3f),
                            sizeof(Vec3f) * static_cast<std::size_t>(width));
  };
  const char* names[] = {"R", "G", "B"};
  if (rgb)
    for (std::size_t c = 0; c < 3; ++c) frame.insert(names[c], slice(c));
  else
    frame.insert("Y", slice(0));
  input.setFrameBuffer(frame);
  input.readPixels(window.min.y, window.max.y);
  if (!rgb)
    for (Vec3f& texel : sky.image) texel = Vec3f(texel.x);
}

}  // namespace

void readSkyImage(const std::filesystem::path& path, Sky& sky, std::vector<std::string>& hashes) {
  const std::string file = path.string();
  const std::vector<std::byte> bytes = readFile(path);
  hashes.push_back(contentHash(bytes));
  try {
    decode(file, bytes, sky);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    throwInput("{}: cannot be read as an EXR image: {}", file, printable(e.what()));
  }
  for (std::size_t i = 0; i < sky.image.size(); ++i)
    if (!isFinite(sky.image[i]) || minComponent(sky.image[i]) < 0)
      throwInput("{}: texel ({}, {}) is negative or not finite; a sky cannot be", file,
                 i % sky.width, i / sky.width);
}

}  // namespace probelab
