// SPDX-License-Identifier: Apache-2.0
// Content hashes (XXH3, 128 bits): identities of files, configurations and cache entries.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace probelab {

// 32 lower-case hexadecimal digits.
std::string contentHash(std::span<const std::byte> bytes);
std::string contentHash(std::string_view text);

}  // namespace probelab
