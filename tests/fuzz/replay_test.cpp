// SPDX-License-Identifier: GPL-3.0-or-later
// Every saved file of the fuzzers, corpus and found inputs, through its harness: nothing but a
// clean load or an InputError, and no allocation out of proportion to the file.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <new>
#include <vector>

#include "fuzz.h"
#include "image_decode.h"

namespace {
std::atomic<std::size_t> largest_request{0};
}

#if !defined(__SANITIZE_ADDRESS__)  // which has operators of its own
void* operator new(std::size_t size) {
  std::size_t before = largest_request;
  while (before < size && !largest_request.compare_exchange_weak(before, size)) {
  }
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#endif

namespace probelab::fuzz {

void PrintTo(const Format& format, std::ostream* out) { *out << format.name; }

namespace {

namespace fs = std::filesystem;

std::vector<fs::path> savedFiles(const std::string& format) {
  std::vector<fs::path> files;
  for (const char* folder : {"corpus", "regressions"}) {
    const fs::path path = fs::path(PROBELAB_FUZZ_FOLDER) / folder / format;
    if (!fs::is_directory(path)) continue;
    for (const auto& entry : fs::directory_iterator(path)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<uint8_t> bytesOf(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class FuzzReplay : public testing::TestWithParam<Format> {};

TEST_P(FuzzReplay, SavedFilesAreLoadedOrRefused) {
  // A chunk of deflated nothing unpacks to 1,032 times its size; voxels and tables of presets come
  // on top, whatever the file.
  constexpr std::size_t kBase = 16 << 20, kFactor = 2 * 1032;
  const std::vector<fs::path> files = savedFiles(GetParam().name);
  ASSERT_FALSE(files.empty());
  GetParam().run({});  // what is set up once
  for (const fs::path& path : files) {
    const std::vector<uint8_t> bytes = bytesOf(path);
    std::fprintf(stderr, "%s\n", path.filename().c_str());  // the last one, should it crash
    largest_request = 0;
    GetParam().run(bytes);
    EXPECT_LE(largest_request, kBase + kFactor * bytes.size()) << path;
  }
}

TEST_P(FuzzReplay, EveryCutOfASeedIsLoadedOrRefused) {
  const std::vector<fs::path> files = savedFiles(GetParam().name);
  const auto smallest = std::min_element(files.begin(), files.end(), [](auto& a, auto& b) {
    return fs::file_size(a) < fs::file_size(b);
  });
  ASSERT_NE(smallest, files.end());
  const std::vector<uint8_t> bytes = bytesOf(*smallest);
  const std::size_t step = std::max<std::size_t>(1, bytes.size() / 64);
  for (std::size_t size = 0; size < bytes.size(); size += step)
    GetParam().run(Bytes(bytes).first(size));
}

// 16,000 x 16,000 texels in 69 bytes: refused before the decoder takes 1 GB for them.
TEST(FuzzReplayPicture, ThatCannotHoldWhatItClaimsIsNotDecoded) {
  std::string why;
  const std::vector<uint8_t> bytes =
      bytesOf(fs::path(PROBELAB_FUZZ_FOLDER) / "corpus/picture/claims.png");
  EXPECT_FALSE(decodeImage(bytes, why).has_value());
  EXPECT_NE(why.find("fewer bytes"), std::string::npos) << why;
}

INSTANTIATE_TEST_SUITE_P(Formats, FuzzReplay, testing::ValuesIn(formats().begin(), formats().end()),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace probelab::fuzz
