// SPDX-License-Identifier: Apache-2.0
// Storage buffers and the copies between them and the host.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "gpu/context.h"

namespace probelab {

enum class MemoryUse {
  device,        // the device's own memory; the host reaches it by upload and download only
  host_visible,  // mapped for the buffer's life, cached where there is such memory (host tracer)
};

struct BufferState;

class GpuBuffer {
 public:
  GpuBuffer();  // empty: only assignment and destruction are allowed
  explicit GpuBuffer(std::unique_ptr<BufferState> state);
  GpuBuffer(GpuBuffer&&) noexcept;
  GpuBuffer& operator=(GpuBuffer&&) noexcept;
  ~GpuBuffer();

  explicit operator bool() const { return state_ != nullptr; }
  std::size_t size() const;  // bytes as asked for
  const std::string& name() const;
  // Null for MemoryUse::device. What the host writes before Commands::submitAndWait the device
  // sees; what the device wrote, the host sees after it.
  std::byte* mapped() const;
  std::uint64_t address() const;  // buffer device address
  BufferState& state() const { return *state_; }

  // The mapped bytes as an array; host_visible only.
  template <class T>
  std::span<T> mappedAs() const {
    static_assert(std::is_trivially_copyable_v<T>);
    return {reinterpret_cast<T*>(mapped()), size() / sizeof(T)};
  }

 private:
  std::unique_ptr<BufferState> state_;
};

// A zeroed buffer for storage, transfers, device addresses and acceleration-structure input. 0
// bytes are allowed (the buffer can be bound, nothing can be copied). DeviceError naming the buffer
// and its size when it exceeds maxStorageBufferRange or memory runs out.
GpuBuffer createBuffer(GpuContext& context, std::size_t bytes, MemoryUse use, std::string name);

// Copy bytes [offset, offset + data.size()) and wait. An access past the end is a bug (CHECK).
void upload(GpuContext& context, GpuBuffer& buffer, std::span<const std::byte> data,
            std::size_t offset = 0);
void download(GpuContext& context, const GpuBuffer& buffer, std::span<std::byte> data,
              std::size_t offset = 0);

// The same for arrays; `first` counts elements.
template <class T>
void uploadArray(GpuContext& context, GpuBuffer& buffer, std::span<const T> data,
                 std::size_t first = 0) {
  static_assert(std::is_trivially_copyable_v<T>);
  upload(context, buffer, std::as_bytes(data), first * sizeof(T));
}
template <class T>
void uploadArray(GpuContext& context, GpuBuffer& buffer, const std::vector<T>& data,
                 std::size_t first = 0) {
  uploadArray(context, buffer, std::span<const T>(data), first);
}
template <class T>
std::vector<T> downloadArray(GpuContext& context, const GpuBuffer& buffer, std::size_t count,
                             std::size_t first = 0) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<T> data(count);
  download(context, buffer, std::as_writable_bytes(std::span<T>(data)), first * sizeof(T));
  return data;
}
// The whole buffer.
template <class T>
std::vector<T> downloadArray(GpuContext& context, const GpuBuffer& buffer) {
  return downloadArray<T>(context, buffer, buffer.size() / sizeof(T));
}
// A buffer that holds `data`.
template <class T>
GpuBuffer createBufferFrom(GpuContext& context, std::span<const T> data, MemoryUse use,
                           std::string name) {
  GpuBuffer buffer = createBuffer(context, data.size_bytes(), use, std::move(name));
  uploadArray(context, buffer, data);
  return buffer;
}
template <class T>
GpuBuffer createBufferFrom(GpuContext& context, const std::vector<T>& data, MemoryUse use,
                           std::string name) {
  return createBufferFrom(context, std::span<const T>(data), use, std::move(name));
}

}  // namespace probelab
