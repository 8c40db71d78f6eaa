// SPDX-License-Identifier: GPL-3.0-or-later
// Dispatches: bindings, push constants, barriers, visibility between host and device, timestamps.
#include "gpu/commands.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "base/timer.h"
#include "gpu_fixture.h"

namespace probelab {
namespace {

class CommandsTest : public GpuMemoryModeTest {
 protected:
  ComputePipeline pipeline(const std::string& text, const PipelineOptions& options) {
    return createPipeline(gpu(), {"test.comp.glsl", {}, text}, options);
  }
  // values[i] = values[i] * factor + summand
  ComputePipeline multiplyAdd() {
    return pipeline(R"(#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(scalar, set = 0, binding = 0) buffer Values { uint values[]; };
layout(push_constant, scalar) uniform Push { uint count; uint factor; uint summand; };
void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < count) values[i] = values[i] * factor + summand;
})",
                    {1, false, 12});
  }
};
INSTANTIATE_TEST_SUITE_P(Memory, CommandsTest, ::testing::Bool(), memoryModeName);

struct MultiplyAdd {
  std::uint32_t count, factor, summand;
};

std::vector<std::uint32_t> countingFrom(std::uint32_t first, std::size_t count) {
  std::vector<std::uint32_t> values(count);
  std::iota(values.begin(), values.end(), first);
  return values;
}

TEST_P(CommandsTest, ADispatchDoublesValues) {
  const ComputePipeline shader = multiplyAdd();
  std::vector<std::uint32_t> values = countingFrom(0, 100'001);
  for (const MemoryUse use : {MemoryUse::device, MemoryUse::host_visible}) {
    const GpuBuffer buffer = createBufferFrom(gpu(), values, use, "values");
    Commands commands(gpu());
    commands.begin();
    commands.dispatch(shader, {&buffer}, nullptr, pushBytes(MultiplyAdd{100'001, 2, 0}),
                      groupCount(values.size(), 64));
    commands.submitAndWait();
    const auto result = downloadArray<std::uint32_t>(gpu(), buffer);
    for (std::uint32_t i = 0; i < result.size(); ++i) ASSERT_EQ(result[i], 2 * i);
  }
}

TEST_P(CommandsTest, BarriersOrderDependentDispatches) {
  // x -> 3 x + 1 two hundred times (more sets than one descriptor pool holds) against the host.
  const ComputePipeline shader = multiplyAdd();
  std::vector<std::uint32_t> expected = countingFrom(5, 5000);
  const GpuBuffer buffer = createBufferFrom(gpu(), expected, MemoryUse::device, "values");
  Commands commands(gpu());
  for (int round = 0; round < 2; ++round) {
    commands.begin();
    for (int i = 0; i < 100; ++i) {
      commands.dispatch(shader, {&buffer}, nullptr, pushBytes(MultiplyAdd{5000, 3, 1}),
                        groupCount(5000, 64));
      commands.barrier();
      for (std::uint32_t& value : expected) value = value * 3 + 1;
    }
    commands.submitAndWait();
    EXPECT_EQ(downloadArray<std::uint32_t>(gpu(), buffer), expected);
  }
}

TEST_P(CommandsTest, HostAndDeviceSeeEachOthersWritesInMappedMemory) {
  const ComputePipeline shader = multiplyAdd();
  const GpuBuffer buffer = createBuffer(gpu(), 4 * 1000, MemoryUse::host_visible, "mapped");
  const std::span<std::uint32_t> values = buffer.mappedAs<std::uint32_t>();
  Commands commands(gpu());
  for (std::uint32_t round = 0; round < 5; ++round) {
    for (std::uint32_t i = 0; i < 1000; ++i) values[i] += i;  // on top of the device's last result
    commands.begin();
    commands.dispatch(shader, {&buffer}, nullptr, pushBytes(MultiplyAdd{1000, 1, 7}), 16);
    commands.submitAndWait();
    for (std::uint32_t i = 0; i < 1000; ++i) ASSERT_EQ(values[i], (round + 1) * (i + 7));
  }
}

TEST_P(CommandsTest, FillsAndCopies) {
  GpuBuffer from = createBufferFrom(gpu(), countingFrom(0, 100), MemoryUse::device, "from");
  GpuBuffer to = createBuffer(gpu(), 400, MemoryUse::host_visible, "to");
  Commands commands(gpu());
  commands.begin();
  commands.fill(to, 9);
  commands.fill(from, 77, 4, 8);
  commands.barrier();
  commands.copy(from, to, 16, 0, 40);
  commands.submitAndWait();
  const auto values = to.mappedAs<std::uint32_t>();
  EXPECT_EQ((std::vector<std::uint32_t>(values.begin() + 8, values.begin() + 16)),
            (std::vector<std::uint32_t>{9, 9, 0, 77, 77, 3, 9, 9}));
}

TEST_P(CommandsTest, SeveralBuffersAndAnUnusedBinding) {
  // Binding 1 is declared, but no code uses it: it need not be bound.
  const ComputePipeline shader = pipeline(R"(#version 460
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) readonly buffer A { uint a[]; };
layout(set = 0, binding = 1) readonly buffer B { uint b[]; };
layout(set = 0, binding = 2) buffer C { uint c[]; };
void main() {
  uint i = gl_WorkGroupID.x + 2 * (gl_WorkGroupID.y + 3 * gl_WorkGroupID.z);
  c[i] = a[i] + (false ? b[i] : 100u);
})",
                                          {3, false, 0});
  const GpuBuffer a = createBufferFrom(gpu(), countingFrom(0, 24), MemoryUse::device, "a");
  const GpuBuffer c = createBuffer(gpu(), 96, MemoryUse::device, "c");
  Commands commands(gpu());
  commands.begin();
  commands.dispatch(shader, {&a, nullptr, &c}, nullptr, {}, 2, 3, 4);
  commands.submitAndWait();
  EXPECT_EQ(downloadArray<std::uint32_t>(gpu(), c), countingFrom(100, 24));
}

TEST_P(CommandsTest, BufferAddressesReachTheBuffer) {
  const ComputePipeline shader = pipeline(R"(#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 1) in;
layout(buffer_reference, scalar) buffer Words { uint words[]; };
layout(push_constant, scalar) uniform Push { Words target; };
void main() { target.words[3] = 42; })",
                                          {0, false, 8});
  const GpuBuffer buffer = createBuffer(gpu(), 16, MemoryUse::device, "target");
  Commands commands(gpu());
  commands.begin();
  commands.dispatch(shader, {}, nullptr, pushBytes(buffer.address()), 1);
  commands.submitAndWait();
  EXPECT_EQ(downloadArray<std::uint32_t>(gpu(), buffer)[3], 42u);
}

TEST_P(CommandsTest, NoWorkIsNoError) {
  const ComputePipeline shader = multiplyAdd();
  const GpuBuffer buffer = createBuffer(gpu(), 0, MemoryUse::device, "empty");
  Commands commands(gpu(), 0);
  commands.begin();
  commands.dispatch(shader, {&buffer}, nullptr, pushBytes(MultiplyAdd{0, 1, 1}), 0);
  commands.dispatch(shader, {&buffer}, nullptr, pushBytes(MultiplyAdd{0, 1, 1}), 1);
  commands.submitAndWait();
  EXPECT_TRUE(commands.timestampsMs().empty());
}

TEST_P(CommandsTest, LimitsAreErrorsThatNameTheShader) {
  const ComputePipeline shader = multiplyAdd();
  const GpuBuffer buffer = createBuffer(gpu(), 4, MemoryUse::device, "values");
  const std::uint32_t limit = gpu().info().max_workgroup_count[1];
  Commands commands(gpu());
  commands.begin();
  if (limit < 0xffffffffu) {
    EXPECT_THROW(commands.dispatch(shader, {&buffer}, nullptr, pushBytes(MultiplyAdd{0, 1, 1}), 1,
                                   limit + 1),
                 DeviceError);
  }
  commands.submitAndWait();
  const std::uint32_t too_many_bytes = gpu().info().max_push_constant_bytes + 4;
  EXPECT_THROW(pipeline("#version 460\nvoid main() {}", {0, false, too_many_bytes}), DeviceError);
}

TEST_P(CommandsTest, TimestampsRiseAndMeasureTheWorkBetweenThem) {
  const ComputePipeline shader = pipeline(R"(#version 460
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer Values { float values[]; };
layout(push_constant) uniform Push { uint steps; };
void main() {
  float x = values[gl_GlobalInvocationID.x];
  for (uint i = 0; i < steps; ++i) x = sin(x) + 1;
  values[gl_GlobalInvocationID.x] = x;
})",
                                          {1, false, 4});
  const GpuBuffer buffer = createBuffer(gpu(), 4 * 4096, MemoryUse::device, "values");
  Commands commands(gpu());
  // The shortest of ten runs: the machine may be busy, and drivers compile with the first dispatch.
  double light_ms = 1e30, heavy_ms = 1e30;
  for (int run = 0; run < 10; ++run) {
    const Timer timer;
    commands.begin();
    commands.timestamp("start");
    commands.dispatch(shader, {&buffer}, nullptr, pushBytes(std::uint32_t{1}), 64);
    commands.barrier();
    commands.timestamp("light");
    commands.dispatch(shader, {&buffer}, nullptr, pushBytes(std::uint32_t{2000}), 64);
    commands.barrier();
    commands.timestamp("heavy");
    commands.submitAndWait();
    const double wall_ms = timer.milliseconds();
    const auto times = commands.timestampsMs();
    ASSERT_EQ(times.size(), 3u);
    EXPECT_EQ(times[0].first, "start");
    EXPECT_EQ(times[2].first, "heavy");
    EXPECT_EQ(times[0].second, 0.0);
    EXPECT_GT(times[1].second, 0.0);
    EXPECT_GT(times[2].second, times[1].second);
    EXPECT_LE(times[2].second, wall_ms);
    light_ms = std::min(light_ms, times[1].second);
    heavy_ms = std::min(heavy_ms, times[2].second - times[1].second);
  }
  EXPECT_GT(heavy_ms, 5 * light_ms);  // 2,000 times the arithmetic
}

TEST_P(CommandsTest, ValidationReportsAMissingBarrier) {
  // So that no messages means something: two writes to the same words without an order.
  DeviceOptions options = testDeviceOptions();
  if (!options.validation) GTEST_SKIP() << "PROBELAB_VALIDATION is not 1";
  options.act_discrete = GetParam();
  GpuContext context(options);
  GpuBuffer buffer = createBuffer(context, 64, MemoryUse::device, "fought over");
  Commands commands(context);
  commands.begin();
  commands.fill(buffer, 1);
  commands.barrier();
  commands.fill(buffer, 2);
  EXPECT_TRUE(context.validationMessages().empty());
  commands.fill(buffer, 3);
  commands.submitAndWait();
  ASSERT_EQ(context.validationMessages().size(), 1u);
  const std::string& message = context.validationMessages()[0];
  EXPECT_NE(message.find("WRITE_AFTER_WRITE"), std::string::npos) << message;
  EXPECT_NE(message.find("fought over"), std::string::npos) << message;
}

TEST(MillisecondsFromTicks, CountsThroughWrapsOfTheCounter) {
  // 36 valid bits, bits above them undefined; 2 ns a tick.
  const std::uint64_t wrap = std::uint64_t{1} << 36;
  const std::vector<std::uint64_t> ticks{wrap - 500'000, wrap - 1,
                                         (std::uint64_t{5} << 40) + 499'999, wrap - 1, 999'999};
  const std::vector<double> times = millisecondsFromTicks(ticks, 36, 2.0);
  const double period_ms = static_cast<double>(wrap) * 2e-6;
  ASSERT_EQ(times.size(), 5u);
  EXPECT_DOUBLE_EQ(times[0], 0.0);
  EXPECT_DOUBLE_EQ(times[1], 0.999998);
  EXPECT_DOUBLE_EQ(times[2], 1.999998);
  EXPECT_DOUBLE_EQ(times[3], period_ms + 0.999998);
  EXPECT_DOUBLE_EQ(times[4], period_ms + 2.999998);
  EXPECT_DOUBLE_EQ(millisecondsFromTicks(std::vector<std::uint64_t>{~0ull, 999'999}, 64, 1.0)[1],
                   1.0);
}

TEST(GroupCount, RoundsUp) {
  EXPECT_EQ(groupCount(0, 64), 0u);
  EXPECT_EQ(groupCount(1, 64), 1u);
  EXPECT_EQ(groupCount(64, 64), 1u);
  EXPECT_EQ(groupCount(65, 64), 2u);
}

}  // namespace
}  // namespace probelab
