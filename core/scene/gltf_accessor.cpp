// SPDX-License-Identifier: Apache-2.0
#include "gltf_accessor.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/error.h"

namespace probelab {
namespace {

// An accessor without bytes behind it (all zeros, or sparse only) may not ask for more than this.
constexpr std::size_t kMaxImplicitElements = 100'000'000;

struct Place {
  const GltfFile& gltf;
  int accessor;
  const std::string& element;

  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throwInput("{}: {}: accessor {} {}", gltf.path, element, accessor,
               fmt::format(format, std::forward<Args>(args)...));
  }
  const tinygltf::Accessor& get() const { return gltf.model.accessors[accessor]; }
};

std::size_t componentBytes(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

template <class T>
T load(const uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

// glTF 2.0, section 3.6.2.2: c / (2^bits - 1), signed max(c / (2^(bits-1) - 1), -1).
float loadNumber(const uint8_t* at, int type, bool normalized) {
  float value = 0, scale = 1;
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      value = load<int8_t>(at), scale = 127;
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      value = load<uint8_t>(at), scale = 255;
      break;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      value = load<int16_t>(at), scale = 32767;
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      value = load<uint16_t>(at), scale = 65535;
      break;
    default:
      return load<float>(at);
  }
  return normalized ? std::max(value / scale, -1.0f) : value;
}

uint32_t loadIndex(const uint8_t* at, int type) {
  if (type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE) return load<uint8_t>(at);
  if (type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT) return load<uint16_t>(at);
  return load<uint32_t>(at);
}

bool isIndexType(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

struct Elements {
  const uint8_t* data = nullptr;
  std::size_t stride = 0;
};

// `count` elements of `bytes` each, from `offset` in a view: the last byte must be inside. The view
// itself was checked against its buffer before parsing.
Elements elementsIn(const Place& place, int view_index, std::size_t offset, std::size_t count,
                    std::size_t bytes, bool strided) {
  PROBELAB_CHECK(bytes > 0);
  const tinygltf::BufferView& view = place.gltf.model.bufferViews[view_index];
  const std::size_t stride = strided && view.byteStride != 0 ? view.byteStride : bytes;
  if (stride < bytes) place.fail("has elements of {} bytes at a stride of {}", bytes, stride);
  const bool fits = offset <= view.byteLength &&
                    (count == 0 || (view.byteLength - offset >= bytes &&
                                    count - 1 <= (view.byteLength - offset - bytes) / stride));
  if (!fits)
    place.fail("runs past its buffer view: {} elements of {} bytes from {}, the view has {} bytes",
               count, bytes, offset, view.byteLength);
  const tinygltf::Buffer& buffer = place.gltf.model.buffers[view.buffer];
  return {buffer.data.data() + view.byteOffset + offset, stride};
}

// Calls set(element index, pointer to the element's bytes) for every element that has bytes.
template <class Set>
void forEachElement(const Place& place, std::size_t bytes, Set set) {
  const tinygltf::Accessor& accessor = place.get();
  if (accessor.bufferView >= 0) {
    const Elements elements =
        elementsIn(place, accessor.bufferView, accessor.byteOffset, accessor.count, bytes, true);
    for (std::size_t i = 0; i < accessor.count; ++i) set(i, elements.data + i * elements.stride);
  } else if (accessor.count > kMaxImplicitElements) {
    place.fail("has {} elements and no data", accessor.count);
  }
  if (!accessor.sparse.isSparse) return;
  const auto& sparse = accessor.sparse;
  const int type = sparse.indices.componentType;
  if (!isIndexType(type)) place.fail("has sparse indices of component type {}", type);
  const std::size_t index_bytes = componentBytes(type), count = sparse.count;
  const Elements indices = elementsIn(place, sparse.indices.bufferView, sparse.indices.byteOffset,
                                      count, index_bytes, false);
  const Elements values =
      elementsIn(place, sparse.values.bufferView, sparse.values.byteOffset, count, bytes, false);
  for (std::size_t i = 0; i < count; ++i) {
    const uint32_t index = loadIndex(indices.data + i * indices.stride, type);
    if (index >= accessor.count)
      place.fail("has sparse index {}, but {} elements", index, accessor.count);
    set(index, values.data + i * values.stride);
  }
}

}  // namespace

int componentsOf(const GltfFile& gltf, int accessor) {
  const int n = tinygltf::GetNumComponentsInType(gltf.model.accessors[accessor].type);
  return n > 0 ? n : 0;
}

std::vector<float> readFloats(const GltfFile& gltf, int accessor_index, int components,
                              const std::string& element) {
  const Place place{gltf, accessor_index, element};
  const tinygltf::Accessor& accessor = place.get();
  const int type = accessor.componentType;
  const std::size_t component_bytes = componentBytes(type);
  if (componentsOf(gltf, accessor_index) != components || components > 4)
    place.fail("has {} components, {} are needed", componentsOf(gltf, accessor_index), components);
  if (component_bytes == 0 || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)
    place.fail("has component type {}, which cannot hold an attribute", type);
  const std::size_t n = components;
  std::vector<float> result;
  // Grown only once the first element was found to be inside the buffer.
  const auto prepare = [&] {
    if (result.empty()) result.resize(accessor.count * n);
  };
  forEachElement(place, component_bytes * n, [&](std::size_t i, const uint8_t* at) {
    prepare();
    for (std::size_t c = 0; c < n; ++c) {
      const float value = loadNumber(at + c * component_bytes, type, accessor.normalized);
      if (!std::isfinite(value)) place.fail("has a value that is not finite at element {}", i);
      result[i * n + c] = value;
    }
  });
  prepare();
  return result;
}

std::vector<uint32_t> readIndices(const GltfFile& gltf, int accessor_index,
                                  const std::string& element) {
  const Place place{gltf, accessor_index, element};
  const tinygltf::Accessor& accessor = place.get();
  if (accessor.type != TINYGLTF_TYPE_SCALAR || !isIndexType(accessor.componentType))
    place.fail("cannot hold indices: it must be SCALAR of unsigned 8, 16 or 32 bit");
  std::vector<uint32_t> result;
  const auto prepare = [&] {
    if (result.empty()) result.resize(accessor.count);
  };
  forEachElement(place, componentBytes(accessor.componentType),
                 [&](std::size_t i, const uint8_t* at) {
                   prepare();
                   result[i] = loadIndex(at, accessor.componentType);
                 });
  prepare();
  return result;
}

}  // namespace probelab
