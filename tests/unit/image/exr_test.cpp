// SPDX-License-Identifier: GPL-3.0-or-later
// EXR files: what is written comes back bit for bit; damaged and hostile files are refused.
#include "image/exr.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "base/files.h"
#include "base/rng.h"

namespace probelab {
namespace {
namespace fs = std::filesystem;

class Exr : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              ("exr_" + std::to_string(getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
    path_ = folder_ / "image.exr";
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string writeAndRead(const ImageFile& file) {
    writeExr(path_, file);
    return readTextFile(path_);
  }
  void replaceFile(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
  }
  // The message of the InputError that reading throws; "" when it reads.
  std::string errorOf(const std::string& bytes) {
    replaceFile(bytes);
    try {
      readExr(path_);
      return "";
    } catch (const InputError& e) {
      return e.what();
    }
  }

  fs::path folder_, path_;
};

Image noiseImage(int width, int height, std::vector<std::string> channels) {
  Image image = makeImage(width, height, std::move(channels));
  Rng rng(1, RngStream::test, uint64_t(width));
  for (float& v : image.data) v = 100 * rng.nextFloat() - 50;
  return image;
}

ImageFile sampleFile() {
  ImageFile file;
  file.layers[""] = noiseImage(13, 200, {"R", "G", "B"});
  file.layers["direct"] = noiseImage(13, 200, {"R", "G", "B"});
  file.layers["normal"] = noiseImage(13, 200, {"X", "Y", "Z"});
  file.layers["depth"] = noiseImage(13, 200, {"Z"});
  file.attributes = {{"probelabSeed", "7"}, {"probelabCommand", "reference \"a b\" --spp 4"}};
  return file;
}

TEST_F(Exr, ComesBackBitForBit) {
  ImageFile file = sampleFile();
  file.layers[""].data[5] = std::numeric_limits<float>::infinity();
  file.layers[""].data[6] = 1e-42f;
  file.layers[""].data[7] = -0.0f;
  writeExr(path_, file);
  const ImageFile read = readExr(path_);
  EXPECT_EQ(read.attributes, file.attributes);
  ASSERT_EQ(read.layers.size(), file.layers.size());
  for (const auto& [name, layer] : file.layers) {
    const Image& other = layerOf(read, name, path_.string());
    EXPECT_EQ(other.width, layer.width);
    EXPECT_EQ(other.height, layer.height);
    EXPECT_EQ(other.channels, layer.channels);
    ASSERT_EQ(other.data.size(), layer.data.size());
    EXPECT_EQ(0, std::memcmp(other.data.data(), layer.data.data(), 4 * layer.data.size())) << name;
  }
}

TEST_F(Exr, SameContentSameBytes) {
  const std::string first = writeAndRead(sampleFile());
  EXPECT_EQ(writeAndRead(sampleFile()), first);
}

TEST_F(Exr, LeavesNothingBesideTheFile) {
  writeExr(path_, sampleFile());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
  EXPECT_THROW(writeExr(folder_ / "missing" / "image.exr", sampleFile()), Error);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(Exr, RefusesAttributesThatAreExrs) {
  ImageFile file = sampleFile();
  file.attributes["dataWindow"] = "mine";
  EXPECT_THROW(writeExr(path_, file), InputError);
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(Exr, NamesMissingFilesAndLayers) {
  EXPECT_THROW(readExr(folder_ / "none.exr"), InputError);
  EXPECT_THROW(readExr(folder_), InputError);
  EXPECT_NE(errorOf("").find("image.exr"), std::string::npos);
  EXPECT_NE(errorOf("this is not an image").find("image.exr"), std::string::npos);
  try {
    layerOf(sampleFile(), "albedo", "a.exr");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("direct"), std::string::npos);
  }
}

TEST_F(Exr, RefusesEveryTruncation) {
  const std::string bytes = writeAndRead(sampleFile());
  for (size_t size = 0; size < bytes.size(); size += 1 + size / 20)
    EXPECT_NE(errorOf(bytes.substr(0, size)), "") << size << " of " << bytes.size();
  EXPECT_NE(errorOf(bytes.substr(0, bytes.size() - 1)), "");
}

// The value of the box attribute `name`, replaced.
std::string withWindow(std::string bytes, const std::string& name, const std::array<int, 4>& box) {
  const std::string key = name + '\0' + "box2i" + '\0';
  const size_t at = bytes.find(key);
  EXPECT_NE(at, std::string::npos);
  std::memcpy(bytes.data() + at + key.size() + 4, box.data(), 16);
  return bytes;
}

TEST_F(Exr, RefusesHugeWindowsBeforeAllocating) {
  const std::string bytes = writeAndRead(sampleFile());
  const int big = std::numeric_limits<int>::max();
  for (const std::array<int, 4>& box :
       {std::array{0, 0, big, big}, std::array{-big, -big, big, big}, std::array{0, 0, 12, big},
        std::array{0, 0, 65534, 65534}, std::array{0, 0, 1 << 20, 3}, std::array{5, 5, 4, 4},
        std::array{0, 0, 65535, 199}})
    EXPECT_NE(errorOf(withWindow(bytes, "dataWindow", box)), "") << box[2] << " " << box[3];
}

TEST_F(Exr, RefusesAFileWithoutChannels) {
  std::string bytes = writeAndRead(sampleFile());
  const std::string key = std::string("channels") + '\0' + "chlist" + '\0';
  const size_t at = bytes.find(key) + key.size();
  uint32_t size = 0;
  std::memcpy(&size, bytes.data() + at, 4);
  const uint32_t one = 1;
  bytes.erase(at + 4, size - 1);
  std::memcpy(bytes.data() + at, &one, 4);
  EXPECT_NE(errorOf(bytes), "");
}

TEST_F(Exr, SurvivesDamageAnywhere) {
  ImageFile file;
  file.layers[""] = noiseImage(5, 20, {"R", "G", "B"});
  file.attributes["key"] = "value";
  const std::string bytes = writeAndRead(file);
  int refused = 0;
  for (size_t i = 0; i < std::min<size_t>(bytes.size(), 500); ++i)
    for (const char value : {'\0', '\x01', '\x7f', '\xff'}) {
      std::string damaged = bytes;
      damaged[i] = value;
      refused += !errorOf(damaged).empty();  // or it reads; it never crashes or hangs
    }
  EXPECT_GT(refused, 500);
}

TEST(Image, GivesTheColourOfItsChannels) {
  Image image = makeImage(1, 1, {"B", "Z", "G", "R"});
  image.data = {3, 9, 2, 1};
  EXPECT_EQ(pixelsOf(image)[0], Vec3f(1, 2, 3));
  EXPECT_EQ(pixelsOf(imageFromValues(1, 1, std::vector<float>{4}, "Z"))[0], Vec3f(4));
  const std::vector<Vec3f> normal = {{0, 1, 0}};
  EXPECT_EQ(pixelsOf(imageFromPixels(1, 1, normal, {"X", "Y", "Z"}))[0], normal[0]);
  EXPECT_THROW(pixelsOf(makeImage(1, 1, {"u", "v"})), InputError);
  EXPECT_EQ(channelIndex(image, "G"), 2);
  EXPECT_EQ(channelIndex(image, "A"), -1);
  image = makeImage(3, 2, {"R", "G"});
  image.at(2, 1, 1) = 5;
  EXPECT_EQ(image.data.back(), 5);
}

}  // namespace
}  // namespace probelab
