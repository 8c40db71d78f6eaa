// SPDX-License-Identifier: GPL-3.0-or-later
// Images: copies, storage writes, bilinear sampling, changes of use, limits.
#include "gpu/image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "base/rng.h"
#include "gpu/commands.h"
#include "gpu_fixture.h"

namespace probelab {
namespace {

constexpr ImageFormat kFormats[] = {ImageFormat::rgba16f, ImageFormat::rgba32f, ImageFormat::rg16f,
                                    ImageFormat::rg32f};
constexpr ImageSize kSize{5, 3, 2};

class ImageTest : public GpuMemoryModeTest {
 protected:
  ComputePipeline pipeline(const std::string& text, const PipelineOptions& options,
                           std::vector<std::pair<std::string, std::string>> defines = {}) {
    return createPipeline(gpu(), {"test.comp.glsl", std::move(defines), text}, options);
  }
  GpuImage uploaded(const ImageSize& size, const std::vector<float>& texels) {
    GpuImage image = createImage(gpu(), ImageFormat::rgba32f, size, "texels");
    upload(gpu(), image, std::as_bytes(std::span<const float>(texels)));
    return image;
  }
  std::vector<std::byte> bytesOf(GpuImage& image) {
    std::vector<std::byte> bytes(image.bytes());
    download(gpu(), image, bytes);
    return bytes;
  }
  // The image through its sampler at (u, v, layer).
  std::vector<Vec4f> sample(GpuImage& image, const std::vector<Vec4f>& coordinates) {
    const ComputePipeline shader = pipeline(R"(#version 460
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer Coordinates { vec4 coordinates[]; };
layout(set = 0, binding = 1) writeonly buffer Results { vec4 results[]; };
layout(set = 0, binding = 2) uniform sampler2DArray image;
void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < coordinates.length()) results[i] = textureLod(image, coordinates[i].xyz, 0.0);
})",
                                            {2, false, 0, 0, 1});
    const GpuBuffer in = createBufferFrom(gpu(), coordinates, MemoryUse::device, "coordinates");
    const GpuBuffer out =
        createBuffer(gpu(), coordinates.size() * sizeof(Vec4f), MemoryUse::device, "results");
    Commands commands(gpu());
    commands.begin();
    commands.setUse(image, ImageUse::sampled);
    commands.dispatch(shader, Bindings{{&in, &out}, nullptr, {}, {&image}}, {},
                      groupCount(coordinates.size(), 64));
    commands.setUse(image, ImageUse::storage);
    commands.submitAndWait();
    return downloadArray<Vec4f>(gpu(), out);
  }
};
INSTANTIATE_TEST_SUITE_P(Memory, ImageTest, ::testing::Bool(), memoryModeName);

TEST_P(ImageTest, UploadThenDownloadKeepsEveryByte) {
  for (const ImageFormat format : kFormats) {
    GpuImage image = createImage(gpu(), format, kSize, "copied");
    ASSERT_EQ(image.bytes(), 30 * texelBytes(format));
    Rng rng(1, RngStream::test, static_cast<uint64_t>(format));
    std::vector<std::byte> bytes(image.bytes());
    // 0x3b and less in the high byte: no NaN, whose bits need not survive.
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(rng.nextBelow(0x3c));
    upload(gpu(), image, bytes);
    EXPECT_EQ(bytesOf(image), bytes) << glslName(format);
  }
}

TEST_P(ImageTest, ANewImageIsZeroAndClearZeroesItAgain) {
  GpuImage image = createImage(gpu(), ImageFormat::rgba32f, kSize, "cleared");
  const std::vector<std::byte> zero(image.bytes());
  EXPECT_EQ(bytesOf(image), zero);
  const std::vector<float> ones(image.bytes() / sizeof(float), 1.0f);
  upload(gpu(), image, std::as_bytes(std::span<const float>(ones)));
  EXPECT_NE(bytesOf(image), zero);
  Commands commands(gpu());
  commands.begin();
  commands.clear(image);
  commands.submitAndWait();
  EXPECT_EQ(bytesOf(image), zero);
}

TEST_P(ImageTest, AShaderStoresAndLoadsTexelsOfEveryFormat) {
  // Texel (x, y, layer) gets 1 + x + 8 y + 64 layer and its negative (exact in half floats), then
  // both are doubled in place; two-channel formats drop the rest.
  const std::string text = R"(#version 460
layout(local_size_x = 1) in;
layout(set = 0, binding = 0, FORMAT) uniform image2DArray image;
layout(push_constant) uniform Push { uint doubles; };
void main() {
  ivec3 p = ivec3(gl_WorkGroupID);
  float value = 1.0 + float(p.x + 8 * p.y + 64 * p.z);
  imageStore(image, p, doubles != 0u ? imageLoad(image, p) * 2.0 : vec4(value, -value, 0.0, 3.0));
})";
  for (const ImageFormat format : kFormats) {
    GpuImage image = createImage(gpu(), format, kSize, "stored");
    const ComputePipeline shader =
        pipeline(text, {0, false, 4, 1, 0}, {{"FORMAT", glslName(format)}});
    Commands commands(gpu());
    commands.begin();
    for (const uint32_t doubles : {0u, 1u}) {
      commands.dispatch(shader, Bindings{{}, nullptr, {&image}, {}}, pushBytes(doubles),
                        kSize.width, kSize.height, kSize.layers);
      commands.barrier();
    }
    commands.submitAndWait();
    const std::vector<std::byte> bytes = bytesOf(image);
    const bool half = format == ImageFormat::rgba16f || format == ImageFormat::rg16f;
    for (uint32_t i = 0; i < 30; ++i) {
      const int expected = 2 * static_cast<int>(1 + i % 5 + 8 * (i / 5 % 3) + 64 * (i / 15));
      const std::byte* texel = bytes.data() + i * texelBytes(format);
      if (half) {
        uint16_t halves[2];
        std::memcpy(halves, texel, sizeof halves);
        // A half float: 10 bits of fraction below the leading one, exponent biased by 15.
        const int exponent = static_cast<int>(std::log2(expected));
        const auto bits =
            static_cast<uint16_t>(((exponent + 15) << 10) + ((expected << 10 >> exponent) - 1024));
        EXPECT_EQ(halves[0], bits) << glslName(format) << " texel " << i;
        EXPECT_EQ(halves[1], bits | 0x8000) << glslName(format) << " texel " << i;
      } else {
        float floats[2];
        std::memcpy(floats, texel, sizeof floats);
        EXPECT_EQ(floats[0], static_cast<float>(expected)) << glslName(format) << " texel " << i;
        EXPECT_EQ(floats[1], static_cast<float>(-expected)) << glslName(format) << " texel " << i;
      }
    }
  }
}

// Two layers of 2 x 2 texels; the value is (a, 0, 0, layer).
std::vector<float> twoByTwo() {
  std::vector<float> texels;
  for (const float layer : {0.0f, 1.0f})
    for (const float a : {0.0f, 4.0f, 8.0f, 20.0f})
      for (const float channel : {a + 100 * layer, 0.0f, 0.0f, layer}) texels.push_back(channel);
  return texels;
}

TEST_P(ImageTest, TheSamplerIsBilinearBetweenTexelCentresAndClamped) {
  GpuImage image = uploaded({2, 2, 2}, twoByTwo());
  const std::vector<Vec4f> at{{0.25f, 0.25f, 0, 0},  {0.75f, 0.25f, 0, 0},   {0.25f, 0.75f, 0, 0},
                              {0.75f, 0.75f, 0, 0},  {0.5f, 0.5f, 0, 0},     {0.5f, 0.25f, 0, 0},
                              {0.375f, 0.25f, 0, 0}, {0.375f, 0.625f, 0, 0}, {0, 0, 0, 0},
                              {1, 0.75f, 0, 0},      {-3, 9, 0, 0},          {0.5f, 0.5f, 1, 0}};
  // By hand: centres at 1/4 and 3/4; (3/8, 5/8) weighs 9/16, 3/16 ... = (3 0 + 4 + 9 8 + 3 20)
  // / 16.
  const std::vector<float> expected{0, 4, 8, 20, 8, 2, 1, 8.5f, 0, 20, 8, 108};
  const std::vector<Vec4f> results = sample(image, at);
  // The fraction has at least 8 bits, so it is within 2^-9 on each of two axes, on each of which
  // the value changes by no more than the contrast of the four texels, 20: 2^-8 of that.
  for (std::size_t i = 0; i < at.size(); ++i)
    EXPECT_NEAR(results[i].x, expected[i], 20 * 0x1p-8) << i;
  EXPECT_EQ(results[11].w, 1.0f);
}

TEST_P(ImageTest, SamplingAgreesWithBilinearArithmeticEverywhere) {
  constexpr int kSide = 7;
  Rng rng(2, RngStream::test);
  std::vector<float> texels(kSide * kSide * 4);
  for (float& texel : texels) texel = rng.nextFloat();
  GpuImage image = uploaded({kSide, kSide, 1}, texels);
  std::vector<Vec4f> at;
  for (int i = 0; i < 1000; ++i)
    at.emplace_back(1.4f * rng.nextFloat() - 0.2f, 1.4f * rng.nextFloat() - 0.2f, 0.0f, 0.0f);
  const std::vector<Vec4f> results = sample(image, at);
  for (std::size_t i = 0; i < at.size(); ++i) {
    const double u = at[i].x * kSide - 0.5, v = at[i].y * kSide - 0.5;
    const double fx = u - std::floor(u), fy = v - std::floor(v);
    const auto tap = [&](int dx, int dy) {
      const int x = std::clamp(static_cast<int>(std::floor(u)) + dx, 0, kSide - 1);
      const int y = std::clamp(static_cast<int>(std::floor(v)) + dy, 0, kSide - 1);
      return static_cast<double>(texels[static_cast<std::size_t>(4 * (y * kSide + x))]);
    };
    const double taps[] = {tap(0, 0), tap(1, 0), tap(0, 1), tap(1, 1)};
    const double expected =
        (taps[0] * (1 - fx) + taps[1] * fx) * (1 - fy) + (taps[2] * (1 - fx) + taps[3] * fx) * fy;
    const auto [low, high] = std::minmax_element(std::begin(taps), std::end(taps));
    // As above; 1e-6 for the rounding of the coordinates.
    ASSERT_NEAR(results[i].x, expected, (*high - *low) * 0x1p-8 + 1e-6) << i;
  }
}

TEST_P(ImageTest, LimitsAreErrorsThatNameTheImage) {
  const auto errorOf = [&](const ImageSize& size) -> std::string {
    try {
      createImage(gpu(), ImageFormat::rg16f, size, "too large");
    } catch (const DeviceError& error) {
      return error.what();
    }
    return "";
  };
  const std::string wide = errorOf({gpu().info().max_image_side + 1, 1, 1});
  EXPECT_NE(wide.find("image 'too large'"), std::string::npos) << wide;
  EXPECT_NE(wide.find(std::to_string(gpu().info().max_image_side)), std::string::npos) << wide;
  EXPECT_NE(errorOf({1, 1, gpu().info().max_image_layers + 1}), "");
  EXPECT_THROW(pipeline("unused", {0, false, 0, gpu().info().max_storage_images_per_stage + 1, 0}),
               DeviceError);
  EXPECT_THROW(pipeline("unused", {0, false, 0, 0, gpu().info().max_sampled_images_per_stage + 1}),
               DeviceError);
}

}  // namespace
}  // namespace probelab
