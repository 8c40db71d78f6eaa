// SPDX-License-Identifier: Apache-2.0
// Recording work for the device, running it, and timing it.
//
//   Commands commands(context);
//   commands.begin();
//   commands.timestamp("start");
//   commands.dispatch(generate, {&rays}, nullptr, pushBytes(params), groupCount(n, 64));
//   commands.barrier();
//   commands.dispatch(trace, {&rays, &hits}, &scene, {}, groupCount(n, 64));
//   commands.timestamp("trace");
//   commands.submitAndWait();
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "gpu/acceleration_structure.h"
#include "gpu/buffer.h"
#include "gpu/context.h"
#include "gpu/image.h"
#include "gpu/pipeline.h"

namespace probelab {

// A plain struct as push constants.
template <class T>
std::span<const std::byte> pushBytes(const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  return std::as_bytes(std::span<const T>(&value, 1));
}

// Workgroups of `group_size` that cover `items`. Fails the CHECK above 2^32 - 1 groups.
std::uint32_t groupCount(std::uint64_t items, std::uint32_t group_size);

// What a dispatch binds, in the order of the pipeline's bindings.
struct Bindings {
  std::vector<const GpuBuffer*> buffers;  // null for a binding that the shader does not use
  const AccelerationStructure* acceleration_structure = nullptr;
  std::vector<const GpuImage*> storage_images;  // in ImageUse::storage
  std::vector<const GpuImage*> sampled_images;  // in ImageUse::sampled
};

struct CommandsState;

// One command buffer. Pipelines, buffers, images and acceleration structures must live until
// submitAndWait returns. begin() starts anew; earlier submissions are finished and visible to it.
class Commands {
 public:
  explicit Commands(GpuContext& context, std::uint32_t max_timestamps = 64);
  Commands(Commands&&) noexcept;
  Commands& operator=(Commands&&) noexcept;
  ~Commands();

  void begin();
  // `buffers` in the order of bindings, as many as the pipeline has; null for a binding that the
  // specialised shader does not use. `as` only where the pipeline has one. `push` has the
  // pipeline's size. Zero groups do nothing. DeviceError above the device's number of workgroups.
  void dispatch(const ComputePipeline& pipeline, std::span<const GpuBuffer* const> buffers,
                const AccelerationStructure* as, std::span<const std::byte> push,
                std::uint32_t groups_x, std::uint32_t groups_y = 1, std::uint32_t groups_z = 1);
  void dispatch(const ComputePipeline& pipeline, std::initializer_list<const GpuBuffer*> buffers,
                const AccelerationStructure* as, std::span<const std::byte> push,
                std::uint32_t groups_x, std::uint32_t groups_y = 1, std::uint32_t groups_z = 1) {
    dispatch(pipeline, std::span<const GpuBuffer* const>(buffers.begin(), buffers.size()), as, push,
             groups_x, groups_y, groups_z);
  }
  // The same for pipelines that have images too.
  void dispatch(const ComputePipeline& pipeline, const Bindings& bindings,
                std::span<const std::byte> push, std::uint32_t groups_x, std::uint32_t groups_y = 1,
                std::uint32_t groups_z = 1);
  // A barrier after which the image can be bound in this way; what it holds is kept.
  void setUse(GpuImage& image, ImageUse use);
  // Zeroes every texel. The image is in ImageUse::storage.
  void clear(GpuImage& image);
  // Everything recorded before is complete and visible to everything after.
  void barrier();
  // 32-bit words; offset and bytes are multiples of 4.
  void fill(GpuBuffer& buffer, std::uint32_t word, std::size_t offset, std::size_t bytes);
  void fill(GpuBuffer& buffer, std::uint32_t word);
  void copy(const GpuBuffer& from, GpuBuffer& to, std::size_t bytes, std::size_t from_offset = 0,
            std::size_t to_offset = 0);
  // The time at which everything recorded before it was complete.
  void timestamp(std::string label);

  // Runs what was recorded and waits for it. The host's writes to mapped buffers before the call
  // are visible to the device, the device's writes to the host after it. DeviceError when the
  // device is lost. begin() must come before the next recording.
  void submitAndWait();
  // Label and milliseconds since the first timestamp (whose value is 0), of the last submission.
  std::vector<std::pair<std::string, double>> timestampsMs() const;

 private:
  std::unique_ptr<CommandsState> state_;
};

// Milliseconds since the first of `ticks`, device counters that count modulo 2^valid_bits; each is
// less than one wrap after the one before.
std::vector<double> millisecondsFromTicks(std::span<const std::uint64_t> ticks,
                                          std::uint32_t valid_bits, double period_ns);

}  // namespace probelab
