// SPDX-License-Identifier: Apache-2.0
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "base/files.h"
#include "exr_names.h"
#include "image/exr.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

// OpenEXR's own file stream keeps small files in a buffer until a destructor writes it, and what
// fails there goes unnoticed. This one remembers.
class CheckedStream : public Imf::OStream {
 public:
  explicit CheckedStream(const fs::path& path)
      : Imf::OStream(path.c_str()), file_(std::fopen(path.c_str(), "wb")) {
    if (!file_) fail();
  }
  ~CheckedStream() override {
    if (file_) std::fclose(file_);
  }
  void write(const char bytes[], int count) override {
    if (std::fwrite(bytes, 1, static_cast<std::size_t>(count), file_) !=
        static_cast<std::size_t>(count))
      fail();
  }
  uint64_t tellp() override { return static_cast<uint64_t>(ftello(file_)); }
  void seekp(uint64_t position) override {
    if (fseeko(file_, static_cast<off_t>(position), SEEK_SET) != 0) fail();
  }
  // Throws when anything has failed until now, wherever it did.
  void close() {
    if (std::fclose(std::exchange(file_, nullptr)) != 0 && error_.empty())
      error_ = std::strerror(errno);
    if (!error_.empty()) throw std::runtime_error(error_);
  }

 private:
  [[noreturn]] void fail() {
    error_ = std::strerror(errno);
    throw std::runtime_error(error_);
  }

  std::FILE* file_;
  std::string error_;
};

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
      CheckedStream stream(temporary);
      Imf::FrameBuffer frame;
      for (const auto& [name, layer] : file.layers)
        for (std::size_t c = 0; c < layer.channels.size(); ++c)
          frame.insert(joinExrName(name, layer.channels[c]),
                       sliceOf(const_cast<float*>(layer.data.data()) + c, layer.channels.size(),
                               {0, 0}, layer.width));
      {
        Imf::OutputFile output(stream, header);
        output.setFrameBuffer(frame);
        output.writePixels(file.layers.begin()->second.height);
      }
      stream.close();
    } catch (const std::exception& e) {
      throw Error(fmt::format("{}: cannot be written: {}", path.string(), e.what()));
    }
  });
}

}  // namespace probelab
