// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include "base/error.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

struct FileCloser {
  void operator()(std::FILE* f) const { std::fclose(f); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

fs::path temporaryPath(const fs::path& path) {
  fs::path temporary = path;
  temporary.replace_filename(fmt::format(".{}.{}.tmp{}", path.stem().string(), getpid(),
                                         path.extension().string()));
  return temporary;
}

}  // namespace

std::vector<std::byte> readFile(const fs::path& path) {
  std::error_code ec;
  if (!fs::exists(path, ec)) throwInput("{}: no such file", path.string());
  if (fs::is_directory(path, ec)) throwInput("{}: is a folder, a file is needed", path.string());
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file) throwInput("{}: cannot be read: {}", path.string(), std::strerror(errno));
  std::vector<std::byte> bytes;
  std::byte chunk[1 << 16];
  for (std::size_t n; (n = std::fread(chunk, 1, sizeof chunk, file.get())) > 0;)
    bytes.insert(bytes.end(), chunk, chunk + n);
  if (std::ferror(file.get())) throwInput("{}: cannot be read: {}", path.string(), std::strerror(errno));
  return bytes;
}

std::string readTextFile(const fs::path& path) {
  const std::vector<std::byte> bytes = readFile(path);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string readCsvFile(const fs::path& path) {
  std::string text = readTextFile(path);
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  return text;
}

void writeFileAtomically(const fs::path& path, const std::function<void(const fs::path&)>& write) {
  const fs::path temporary = temporaryPath(path);
  std::error_code ec;
  try {
    write(temporary);
  } catch (...) {
    fs::remove(temporary, ec);
    throw;
  }
  fs::rename(temporary, path, ec);
  if (ec) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw Error(fmt::format("{}: cannot be written: {}", path.string(), ec.message()));
  }
}

void writeTextFile(const fs::path& path, std::string_view text) {
  writeFileAtomically(path, [&](const fs::path& temporary) {
    File file(std::fopen(temporary.c_str(), "wb"));
    const bool written = file && std::fwrite(text.data(), 1, text.size(), file.get()) == text.size();
    const bool closed = file && std::fclose(file.release()) == 0;
    if (!written || !closed)
      throw Error(fmt::format("{}: cannot be written: {}", path.string(), std::strerror(errno)));
  });
}

void checkWritable(const fs::path& path) {
  std::error_code ec;
  if (fs::is_directory(path, ec)) throwInput("{}: is a folder, name a file", path.string());
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ec))
    throwInput("{}: the folder {} does not exist; create it first", path.string(), folder.string());
  const fs::path probe = temporaryPath(path);
  const File file(std::fopen(probe.c_str(), "wb"));
  if (!file) throwInput("{}: cannot be written: {}", path.string(), std::strerror(errno));
  fs::remove(probe, ec);
}

}  // namespace probelab
