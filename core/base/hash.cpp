// SPDX-License-Identifier: Apache-2.0
#include "base/hash.h"

#include <fmt/format.h>
#include <xxhash.h>

namespace probelab {

std::string contentHash(std::span<const std::byte> bytes) {
  const XXH128_hash_t h = XXH3_128bits(bytes.data(), bytes.size());
  return fmt::format("{:016x}{:016x}", h.high64, h.low64);
}

std::string contentHash(std::string_view text) {
  return contentHash(std::as_bytes(std::span<const char>(text.data(), text.size())));
}

}  // namespace probelab
