// SPDX-License-Identifier: Apache-2.0
// Triangles for ray queries: one bottom-level structure and a top-level one with an identity
// instance.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/vec.h"
#include "gpu/buffer.h"
#include "gpu/context.h"

namespace probelab {

struct AccelerationState;

class AccelerationStructure {
 public:
  AccelerationStructure();  // empty: only assignment and destruction are allowed
  explicit AccelerationStructure(std::unique_ptr<AccelerationState> state);
  AccelerationStructure(AccelerationStructure&&) noexcept;
  AccelerationStructure& operator=(AccelerationStructure&&) noexcept;
  ~AccelerationStructure();

  explicit operator bool() const { return state_ != nullptr; }
  // Runs of triangles of equal opacity are geometries of their own. In a shader
  //   triangle = first_triangle[geometry index] + primitive index,
  // where first_triangle is this buffer of uint; with one geometry, triangle = primitive index.
  std::uint32_t geometryCount() const;
  const GpuBuffer& firstTriangles() const;
  std::uint64_t bytes() const;  // of both structures
  AccelerationState& state() const { return *state_; }

 private:
  std::unique_ptr<AccelerationState> state_;
};

// indices: 3 per triangle into positions; opaque: one per triangle, 0 = a ray query reports the
// triangle as a candidate (alpha test), or empty when all are opaque. Above 4,096 runs of opacity
// there is one geometry without the opaque flag, so a shader's alpha test must accept opaque
// triangles too. No triangles give a scene that every ray misses. Nothing is culled by facing.
// DeviceError when the device has no ray queries or a limit is exceeded.
AccelerationStructure buildAccelerationStructure(GpuContext& context,
                                                 std::span<const Vec3f> positions,
                                                 std::span<const std::uint32_t> indices,
                                                 std::span<const std::uint8_t> opaque = {});

}  // namespace probelab
