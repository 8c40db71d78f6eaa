// SPDX-License-Identifier: Apache-2.0
#include "file_guard.h"

#include <algorithm>
#include <cctype>
#include <optional>

#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "warnings.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string decodePercent(const std::string& uri) {
  std::string result;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool escape = uri[i] == '%' && i + 2 < uri.size() && hexDigit(uri[i + 1]) >= 0 &&
                        hexDigit(uri[i + 2]) >= 0;
    if (!escape) {
      result += uri[i];
      continue;
    }
    result += static_cast<char>(hexDigit(uri[i + 1]) * 16 + hexDigit(uri[i + 2]));
    i += 2;
  }
  return result;
}

// "file:", "http:", "C:" and the like; also anything on a network share.
bool isAbsolute(const std::string& path) {
  if (path.empty() || path[0] == '/' || path[0] == '\\') return true;
  const std::size_t colon = path.find(':');
  return colon != std::string::npos && colon < path.find('/');
}

// Why a decoded URI is refused, before the file system is asked; nothing when it is fine.
std::optional<std::string> refusal(const std::string& decoded) {
  if (decoded.empty()) return "is empty";
  if (std::any_of(decoded.begin(), decoded.end(),
                  [](char c) { return static_cast<unsigned char>(c) < 0x20; }))
    return "has a control character in it";
  if (isAbsolute(decoded)) return "is absolute";
  if (decoded.find('\\') != std::string::npos) return "has a backslash in it";
  const fs::path normal = fs::path(decoded).lexically_normal();
  if (normal.begin() != normal.end() && *normal.begin() == "..")
    return "leads out of the scene's folder";
  return std::nullopt;
}

}  // namespace

FileGuard::FileGuard(const fs::path& scene_file) : scene_file_(scene_file.string()) {
  folder_ = plainPath(fs::absolute(scene_file).parent_path());
}

bool FileGuard::inFolder(const fs::path& path) const {
  const auto [end, rest] = std::mismatch(folder_.begin(), folder_.end(), path.begin(), path.end());
  return end == folder_.end() && rest != path.end();
}

fs::path FileGuard::resolve(const std::string& uri, const std::string& element) const {
  // Decoded twice: a reader behind us that decodes once more must not find a way out either.
  const std::string decoded = decodePercent(uri);
  for (const std::string& text : {decoded, decodePercent(decoded)})
    if (const auto why = refusal(text))
      throwInput("{}: {}: URI '{}' {}; only files beside the scene are read", scene_file_, element,
                 printable(uri), *why);
  std::error_code ec;
  const fs::path path = fs::weakly_canonical(folder_ / decoded, ec);
  if (ec || !inFolder(path))
    throwInput(
        "{}: {}: URI '{}' leads out of the scene's folder through a link; only files beside "
        "the scene are read",
        scene_file_, element, printable(uri));
  return path;
}

void FileGuard::expect(const std::string& uri, const fs::path& path) {
  // tinygltf takes a '+' for a space, which in a path it is not.
  std::string name = uri;
  std::replace(name.begin(), name.end(), '+', ' ');
  expected_[(folder_ / "").string() + decodePercent(name)] = path;
}

bool FileGuard::allows(const std::string& path) const {
  const auto it = expected_.find(path);
  if (it == expected_.end()) return false;
  std::error_code ec;
  const fs::path canonical = fs::weakly_canonical(it->second, ec);
  return !ec && inFolder(canonical) && fs::is_regular_file(canonical, ec);
}

std::vector<unsigned char> FileGuard::read(const std::string& path) {
  if (!allows(path)) throwInput("{}: '{}' is not a file beside the scene", scene_file_, path);
  const fs::path& expected = expected_.at(path);
  const std::vector<std::byte> bytes = readFile(expected);
  hashes_.push_back(contentHash(bytes));
  std::size_t size = bytes.size();
  if (const auto it = declared_.find(expected); it != declared_.end())
    size = std::min(size, it->second);
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  return {data, data + size};
}

void FileGuard::declareLength(const fs::path& path, std::size_t bytes) {
  std::size_t& length = declared_[path];
  length = std::max(length, bytes);
}

}  // namespace probelab
