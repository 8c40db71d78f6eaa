// SPDX-License-Identifier: GPL-3.0-or-later
// Contents, offsets and errors of buffers, in shared and in staged memory.
#include "gpu/buffer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "gpu_fixture.h"

namespace probelab {
namespace {

class BufferTest : public GpuMemoryModeTest {};
INSTANTIATE_TEST_SUITE_P(Memory, BufferTest, ::testing::Bool(), memoryModeName);

std::vector<std::byte> pattern(std::size_t count) {
  std::vector<std::byte> bytes(count);
  for (std::size_t i = 0; i < count; ++i)
    bytes[i] = static_cast<std::byte>((i * 31 + i / 251) & 255);
  return bytes;
}

TEST_P(BufferTest, StartsAsZeroesEvenInMemoryThatWasUsedBefore) {
  for (const MemoryUse use : {MemoryUse::device, MemoryUse::host_visible})
    for (int round = 0; round < 3; ++round) {
      GpuBuffer buffer = createBuffer(gpu(), 1'000'003, use, "zeroes");
      const auto bytes = downloadArray<std::byte>(gpu(), buffer);
      ASSERT_EQ(bytes.size(), 1'000'003u);
      EXPECT_EQ(std::count(bytes.begin(), bytes.end(), std::byte{0}), 1'000'003);
      upload(gpu(), buffer, pattern(buffer.size()));
    }
}

TEST_P(BufferTest, KeepsWhatWasUploadedAtAnyOffsetAndSize) {
  // Odd sizes and offsets, and sizes above the staging buffer's 16 MiB.
  for (const MemoryUse use : {MemoryUse::device, MemoryUse::host_visible}) {
    const std::size_t size = (std::size_t{40} << 20) + 7;
    GpuBuffer buffer = createBuffer(gpu(), size, use, "pattern");
    std::vector<std::byte> expected(size);
    for (const auto& [offset, count] : {std::pair<std::size_t, std::size_t>{0, size},
                                        {13, 1},
                                        {17, (16u << 20) + 5},
                                        {size - 3, 3},
                                        {size, 0}}) {
      std::vector<std::byte> data = pattern(count);
      std::reverse(data.begin(), data.end());
      upload(gpu(), buffer, data, offset);
      std::copy(data.begin(), data.end(), expected.begin() + static_cast<std::ptrdiff_t>(offset));
    }
    EXPECT_TRUE(downloadArray<std::byte>(gpu(), buffer) == expected);
    std::vector<std::byte> part((33u << 20) + 1);
    download(gpu(), buffer, part, 12);
    EXPECT_TRUE(std::equal(part.begin(), part.end(), expected.begin() + 12));
  }
}

TEST_P(BufferTest, ArraysCountInElements) {
  GpuBuffer buffer =
      createBufferFrom(gpu(), std::vector<float>{1, 2, 3, 4, 5}, MemoryUse::device, "numbers");
  uploadArray(gpu(), buffer, std::vector<float>{20, 30}, 1);
  EXPECT_EQ(downloadArray<float>(gpu(), buffer), (std::vector<float>{1, 20, 30, 4, 5}));
  EXPECT_EQ(downloadArray<float>(gpu(), buffer, 2, 3), (std::vector<float>{4, 5}));
}

TEST_P(BufferTest, OnlyHostVisibleBuffersAreMapped) {
  const GpuBuffer device = createBuffer(gpu(), 64, MemoryUse::device, "device");
  const GpuBuffer host = createBuffer(gpu(), 64, MemoryUse::host_visible, "host");
  EXPECT_EQ(device.mapped(), nullptr);
  ASSERT_NE(host.mapped(), nullptr);
  EXPECT_EQ(host.mappedAs<float>().size(), 16u);
  EXPECT_NE(device.address(), 0u);
  EXPECT_NE(device.address(), host.address());
}

TEST_P(BufferTest, CanBeEmptyAndMoved) {
  GpuBuffer empty = createBuffer(gpu(), 0, MemoryUse::device, "empty");
  EXPECT_EQ(empty.size(), 0u);
  EXPECT_TRUE(downloadArray<float>(gpu(), empty).empty());
  GpuBuffer moved = std::move(empty);
  EXPECT_FALSE(empty);
  moved = createBuffer(gpu(), 8, MemoryUse::host_visible, "other");
  EXPECT_EQ(moved.size(), 8u);
}

TEST_P(BufferTest, AboveTheDevicesLimitTheErrorNamesBufferAndSize) {
  const std::size_t bytes = gpu().info().max_storage_buffer_range + 1;
  try {
    createBuffer(gpu(), bytes, MemoryUse::device, "hits");
    FAIL() << "no error";
  } catch (const DeviceError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("'hits'"), std::string::npos) << text;
    EXPECT_NE(text.find(std::to_string(bytes)), std::string::npos) << text;
    EXPECT_NE(text.find("maxStorageBufferRange"), std::string::npos) << text;
  }
}

TEST_P(BufferTest, OfTheGreatestSizeWorks) {
  const std::size_t limit = gpu().info().max_storage_buffer_range;
  if (limit > (std::size_t{256} << 20)) GTEST_SKIP() << "more memory than a test should take";
  const GpuBuffer buffer = createBuffer(gpu(), limit, MemoryUse::device, "largest");
  EXPECT_EQ(downloadArray<std::uint32_t>(gpu(), buffer, 1, limit / 4 - 1)[0], 0u);
}

}  // namespace
}  // namespace probelab
