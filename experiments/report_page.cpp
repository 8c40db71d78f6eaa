// SPDX-License-Identifier: GPL-3.0-or-later
#include "report_page.h"

#include <array>
#include <stdexcept>

#include "base/error.h"
#include "page_files.h"
#include "table.h"

namespace probelab {
namespace {

std::string_view pageFile(std::string_view name) {
  for (const EmbeddedFile& file : pageFiles())
    if (file.name == name) return file.text;
  throw std::logic_error("no page file " + std::string(name));
}

// In the order in which they are run.
constexpr std::array<const char*, 8> kScripts = {"base",    "tables", "figures", "pixels",
                                                 "compare", "camera", "scene",   "start"};

// Puts `text` in the place of the mark, which the page has once.
void fill(std::string& page, const std::string& mark, std::string_view text) {
  const std::size_t at = page.find(mark);
  PROBELAB_CHECK(at != std::string::npos);
  page.replace(at, mark.size(), text);
}

}  // namespace

std::string encodeBase64(std::span<const std::byte> bytes) {
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t word = 0;
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    for (std::size_t k = 0; k < 3; ++k)
      word = word << 8 | (k < count ? std::to_integer<uint32_t>(bytes[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k)
      text.push_back(k <= count ? kDigits[word >> (18 - 6 * k) & 63] : '=');
  }
  return text;
}

std::string scriptJson(const Json& json) {
  const std::string plain = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string text;
  text.reserve(plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    const std::string_view rest = std::string_view(plain).substr(i, 3);
    if (plain[i] == '<' || plain[i] == '>' || plain[i] == '&') {
      text += fmt::format("\\u{:04x}", static_cast<unsigned>(plain[i]));
    } else if (rest == "\u2028" || rest == "\u2029") {
      text += rest == "\u2028" ? "\\u2028" : "\\u2029";
      i += 2;
    } else {
      text.push_back(plain[i]);
    }
  }
  return text;
}

std::string escapeHtml(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped.push_back(c);
    }
  }
  return escaped;
}

std::size_t ReportPage::addBlob(std::span<const std::byte> bytes, const std::string& what) {
  const uint64_t encoded = (bytes.size() + 2) / 3 * 4;
  if (blob_bytes_ + encoded > most_bytes_)
    throwInput(
        "{}: brings the page to {}, more than {}; leave some images or figures out, or raise "
        "--max-mib",
        what, formatBytes(static_cast<double>(blob_bytes_ + encoded)),
        formatBytes(static_cast<double>(most_bytes_)));
  blob_bytes_ += encoded;
  blobs_.push_back(encodeBase64(bytes));
  return blobs_.size() - 1;
}

std::string ReportPage::html(const std::string& title, const Json& data) const {
  std::string blobs;
  for (std::size_t i = 0; i < blobs_.size(); ++i)
    blobs += fmt::format("<script type=\"text/plain\" id=\"blob-{}\">{}</script>\n", i, blobs_[i]);
  std::string scripts;
  for (const char* name : kScripts) scripts += pageFile(name);
  std::string page(pageFile("page"));
  // From the end, so that no content is searched for a mark.
  fill(page, "{{scripts}}", scripts);
  fill(page, "{{blobs}}", blobs);
  fill(page, "{{data}}", scriptJson(data));
  fill(page, "{{style}}", pageFile("style"));
  fill(page, "{{title}}", escapeHtml(title));
  return page;
}

}  // namespace probelab
