// SPDX-License-Identifier: Apache-2.0
// Builds on the device, one structure after the other; build input and scratch memory are freed
// afterwards.
#include "gpu/acceleration_structure.h"

#include <cstring>
#include <limits>

#include "pipeline_state.h"

namespace probelab {
namespace {

constexpr std::size_t kMaxRuns = 4096;

struct Run {
  std::uint32_t first = 0, count = 0;
  bool opaque = true;
};

std::vector<Run> opacityRuns(std::uint32_t triangles, std::span<const std::uint8_t> opaque) {
  if (triangles == 0) return {};
  if (opaque.empty()) return {{0, triangles, true}};
  std::vector<Run> runs;
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const bool is_opaque = opaque[i] != 0;
    if (runs.empty() || runs.back().opaque != is_opaque) runs.push_back({i, 0, is_opaque});
    ++runs.back().count;
    if (runs.size() > kMaxRuns) return {{0, triangles, false}};
  }
  return runs;
}

// What a build of either level reads.
struct BuildInput {
  VkAccelerationStructureTypeKHR type;
  std::vector<VkAccelerationStructureGeometryKHR> geometries;
  std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
};

BuildInput triangleInput(const std::vector<Run>& runs, const GpuBuffer& positions,
                         std::uint32_t position_count, const GpuBuffer& indices) {
  BuildInput input{VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, {}, {}};
  for (const Run& run : runs) {
    VkAccelerationStructureGeometryKHR geometry{
        VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
    geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
    // A candidate must be reported once, or a shader that counts crossings goes wrong.
    geometry.flags = run.opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR
                                : VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR;
    auto& triangles = geometry.geometry.triangles;
    triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
    triangles.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
    triangles.vertexData.deviceAddress = positions.address();
    triangles.vertexStride = sizeof(Vec3f);
    triangles.maxVertex = position_count - 1;
    triangles.indexType = VK_INDEX_TYPE_UINT32;
    triangles.indexData.deviceAddress = indices.address();
    input.geometries.push_back(geometry);
    constexpr std::uint32_t bytes_per_triangle = 3 * sizeof(std::uint32_t);
    input.ranges.push_back({run.count, run.first * bytes_per_triangle, 0, 0});
  }
  return input;
}

BuildInput instanceInput(const GpuBuffer& instances, std::uint32_t count) {
  VkAccelerationStructureGeometryKHR geometry{
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
  geometry.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
  geometry.geometry.instances = {
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR};
  geometry.geometry.instances.data.deviceAddress = instances.address();
  return {VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, {geometry}, {{count, 0, 0, 0}}};
}

std::uint64_t alignUp(std::uint64_t value, std::uint64_t alignment) {
  return (value + alignment - 1) / alignment * alignment;
}

GpuBuffer inputBuffer(VulkanState& state, std::span<const std::byte> data, const char* name) {
  GpuBuffer buffer =
      createRawBuffer(state, data.size(), MemoryUse::host_visible,
                      VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR, name);
  if (!data.empty()) std::memcpy(buffer.mapped(), data.data(), data.size());
  return buffer;
}

void createStructure(VulkanState& state, VkAccelerationStructureTypeKHR type, std::uint64_t bytes,
                     const char* name, GpuBuffer& memory,
                     Handle<VkAccelerationStructureKHR>& structure) {
  memory = createRawBuffer(state, bytes, MemoryUse::device,
                           VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR, name);
  VkAccelerationStructureCreateInfoKHR info{
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
  info.buffer = memory.state().buffer.get();
  info.size = bytes;
  info.type = type;
  VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
  checkVulkan(state.functions.create_acceleration_structure(state.device, &info, nullptr, &handle),
              "vkCreateAccelerationStructureKHR", name);
  structure = {state.device, handle, state.functions.destroy_acceleration_structure};
  setName(state, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, handle, name);
}

void buildStructure(VulkanState& state, const BuildInput& input, const char* name,
                    GpuBuffer& memory, Handle<VkAccelerationStructureKHR>& structure) {
  VkAccelerationStructureBuildGeometryInfoKHR build{
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
  build.type = input.type;
  build.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
  build.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
  build.geometryCount = static_cast<std::uint32_t>(input.geometries.size());
  build.pGeometries = input.geometries.data();
  std::vector<std::uint32_t> counts;
  for (const auto& range : input.ranges) counts.push_back(range.primitiveCount);
  VkAccelerationStructureBuildSizesInfoKHR sizes{
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
  state.functions.acceleration_structure_sizes(
      state.device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, counts.data(), &sizes);
  createStructure(state, input.type, sizes.accelerationStructureSize, name, memory, structure);

  const std::uint64_t alignment =
      state.physical.acceleration.minAccelerationStructureScratchOffsetAlignment;
  const GpuBuffer scratch =
      createRawBuffer(state, sizes.buildScratchSize + alignment, MemoryUse::device,
                      VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, "acceleration structure scratch");
  build.dstAccelerationStructure = structure.get();
  build.scratchData.deviceAddress = alignUp(scratch.address(), alignment);
  const VkAccelerationStructureBuildRangeInfoKHR* ranges = input.ranges.data();
  beginCommands(state, state.transfer);
  state.functions.build_acceleration_structures(state.transfer.commands, 1, &build, &ranges);
  submitCommands(state, state.transfer);
}

void checkLimits(const GpuContext& context, std::size_t triangles) {
  const DeviceInfo& device = context.info();
  if (!device.ray_query)
    throw DeviceError(
        fmt::format("device '{}' has no ray queries (VK_KHR_ray_query); use the "
                    "'embree' tracer",
                    device.name));
  // Byte offsets of triangles in the index buffer are 32-bit numbers, too.
  const std::uint64_t limit =
      std::min<std::uint64_t>(context.state().physical.acceleration.maxPrimitiveCount,
                              std::numeric_limits<std::uint32_t>::max() / 12);
  if (triangles > limit)
    throw DeviceError(fmt::format("{} triangles: the device's acceleration structures hold {}",
                                  triangles, limit));
}

std::vector<VkAccelerationStructureInstanceKHR> instanceOf(
    const VulkanState& state, const Handle<VkAccelerationStructureKHR>& bottom) {
  if (!bottom) return {};
  VkAccelerationStructureDeviceAddressInfoKHR address{
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR};
  address.accelerationStructure = bottom.get();
  VkAccelerationStructureInstanceKHR instance{};
  for (int i = 0; i < 3; ++i) instance.transform.matrix[i][i] = 1;
  instance.mask = 0xff;
  instance.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
  instance.accelerationStructureReference =
      state.functions.acceleration_structure_address(state.device, &address);
  return {instance};
}

}  // namespace

AccelerationStructure::AccelerationStructure() = default;
AccelerationStructure::AccelerationStructure(std::unique_ptr<AccelerationState> state)
    : state_(std::move(state)) {}
AccelerationStructure::AccelerationStructure(AccelerationStructure&&) noexcept = default;
AccelerationStructure& AccelerationStructure::operator=(AccelerationStructure&&) noexcept = default;
AccelerationStructure::~AccelerationStructure() = default;

std::uint32_t AccelerationStructure::geometryCount() const { return state_->geometry_count; }
const GpuBuffer& AccelerationStructure::firstTriangles() const { return state_->first_triangles; }
std::uint64_t AccelerationStructure::bytes() const {
  return (state_->bottom_memory ? state_->bottom_memory.size() : 0) + state_->top_memory.size();
}

AccelerationStructure buildAccelerationStructure(GpuContext& context,
                                                 std::span<const Vec3f> positions,
                                                 std::span<const std::uint32_t> indices,
                                                 std::span<const std::uint8_t> opaque) {
  const std::size_t triangle_count = indices.size() / 3;
  PROBELAB_CHECK_EQ(indices.size() % 3, 0u);
  PROBELAB_CHECK(opaque.empty() || opaque.size() == triangle_count);
  checkLimits(context, triangle_count);
  for (const std::uint32_t index : indices) PROBELAB_CHECK(index < positions.size());

  VulkanState& state = context.state();
  auto result = std::make_unique<AccelerationState>();
  const std::vector<Run> runs = opacityRuns(static_cast<std::uint32_t>(triangle_count), opaque);
  std::vector<std::uint32_t> first_triangles;
  for (const Run& run : runs) first_triangles.push_back(run.first);
  result->geometry_count = static_cast<std::uint32_t>(runs.size());
  result->first_triangles = createBufferFrom(context, first_triangles, MemoryUse::device,
                                             "first triangle of each geometry");
  if (!runs.empty()) {
    const GpuBuffer position_input =
        inputBuffer(state, std::as_bytes(positions), "positions for the acceleration structure");
    const GpuBuffer index_input =
        inputBuffer(state, std::as_bytes(indices), "indices for the acceleration structure");
    buildStructure(state,
                   triangleInput(runs, position_input, static_cast<std::uint32_t>(positions.size()),
                                 index_input),
                   "bottom-level acceleration structure", result->bottom_memory, result->bottom);
  }
  const auto instances = instanceOf(state, result->bottom);
  const GpuBuffer instance_input = inputBuffer(state, std::as_bytes(std::span(instances)),
                                               "instances for the acceleration structure");
  buildStructure(state, instanceInput(instance_input, static_cast<std::uint32_t>(instances.size())),
                 "top-level acceleration structure", result->top_memory, result->top);
  return AccelerationStructure(std::move(result));
}

}  // namespace probelab
