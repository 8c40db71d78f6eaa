// SPDX-License-Identifier: GPL-3.0-or-later
// One HTML file that needs nothing else: the page's own text (experiments/page), a JSON object with
// what it shows, and large data as base64, which the JSON names by index. The same content gives
// the same bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "json.h"

namespace probelab {

// RFC 4648, section 4, with padding.
std::string encodeBase64(std::span<const std::byte> bytes);

// JSON that may stand in a script element: no '<', '>' or '&' and no line separators in it,
// whatever the strings hold. Bytes that are not UTF-8 become U+FFFD.
std::string scriptJson(const Json& json);

// & < > " ' as entities.
std::string escapeHtml(std::string_view text);

class ReportPage {
 public:
  // At most so many bytes of large data, as they stand in the file.
  explicit ReportPage(uint64_t most_bytes) : most_bytes_(most_bytes) {}

  // The index by which the JSON names the data. Throws InputError naming `what` where the page
  // would grow too large: nothing is ever left out or made smaller for that.
  std::size_t addBlob(std::span<const std::byte> bytes, const std::string& what);
  uint64_t blobBytes() const { return blob_bytes_; }

  // The file. `data` is what the scripts read.
  std::string html(const std::string& title, const Json& data) const;

 private:
  uint64_t most_bytes_;
  uint64_t blob_bytes_ = 0;
  std::vector<std::string> blobs_;
};

}  // namespace probelab
