// SPDX-License-Identifier: Apache-2.0
// Copies between host arrays and buffers: directly where the memory is mapped, otherwise in pieces
// through the context's staging buffer.
#include <algorithm>
#include <cstring>

#include "gpu/buffer.h"
#include "vulkan_state.h"

namespace probelab {
namespace {

constexpr std::size_t kStagingBytes = 16 << 20;

const BufferState& stagingBuffer(VulkanState& state) {
  if (!state.staging)
    state.staging = createRawBuffer(
        state, kStagingBytes, MemoryUse::host_visible,
        VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT, "staging");
  return state.staging.state();
}

void copyAndWait(VulkanState& state, VkBuffer from, std::size_t from_offset, VkBuffer to,
                 std::size_t to_offset, std::size_t bytes) {
  beginCommands(state, state.transfer);
  const VkBufferCopy region{from_offset, to_offset, bytes};
  vkCmdCopyBuffer(state.transfer.commands, from, to, 1, &region);
  submitCommands(state, state.transfer);
}

void checkRange(const GpuBuffer& buffer, std::size_t offset, std::size_t bytes) {
  PROBELAB_CHECK(offset <= buffer.size() && bytes <= buffer.size() - offset);
}

}  // namespace

void upload(GpuContext& context, GpuBuffer& buffer, std::span<const std::byte> data,
            std::size_t offset) {
  checkRange(buffer, offset, data.size());
  if (data.empty()) return;
  const BufferState& target = buffer.state();
  if (target.mapped != nullptr) {
    std::memcpy(target.mapped + offset, data.data(), data.size());
    return;
  }
  VulkanState& state = context.state();
  const BufferState& staging = stagingBuffer(state);
  for (std::size_t done = 0; done < data.size(); done += kStagingBytes) {
    const std::size_t piece = std::min(kStagingBytes, data.size() - done);
    std::memcpy(staging.mapped, data.data() + done, piece);
    copyAndWait(state, staging.buffer.get(), 0, target.buffer.get(), offset + done, piece);
  }
}

void download(GpuContext& context, const GpuBuffer& buffer, std::span<std::byte> data,
              std::size_t offset) {
  checkRange(buffer, offset, data.size());
  if (data.empty()) return;
  const BufferState& source = buffer.state();
  if (source.mapped != nullptr) {
    std::memcpy(data.data(), source.mapped + offset, data.size());
    return;
  }
  VulkanState& state = context.state();
  const BufferState& staging = stagingBuffer(state);
  for (std::size_t done = 0; done < data.size(); done += kStagingBytes) {
    const std::size_t piece = std::min(kStagingBytes, data.size() - done);
    copyAndWait(state, source.buffer.get(), offset + done, staging.buffer.get(), 0, piece);
    std::memcpy(data.data() + done, staging.mapped, piece);
  }
}

}  // namespace probelab
