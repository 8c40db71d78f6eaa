// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "base/error.h"
#include "base/interrupt.h"

namespace probelab {
namespace fs = std::filesystem;
namespace {

struct FileCloser {
  void operator()(std::FILE* f) const { std::fclose(f); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

fs::path temporaryPath(const fs::path& path) {
  fs::path temporary = path;
  temporary.replace_filename(
      fmt::format(".{}.{}.tmp{}", path.stem().string(), processTag(), path.extension().string()));
  return temporary;
}

// Where links lead, also to a file that is not there yet.
fs::path targetOf(fs::path path) {
  constexpr int kMostLinks = 40;
  std::error_code ec;
  for (int i = 0; i < kMostLinks && fs::is_symlink(path, ec); ++i)
    path = path.parent_path() / fs::read_symlink(path, ec);
  return path;
}

// A file that takes the place of a device or a pipe would end it for everybody.
void refuseSpecialFile(const fs::path& path) {
  std::error_code ec;
  if (fs::exists(path, ec) && !fs::is_regular_file(path, ec))
    throwInput("{}: exists and is no regular file; name another", path.string());
}

// Without dots, which separate the parts of temporary names.
std::string hostName() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  std::string host = name;
  std::replace(host.begin(), host.end(), '.', '_');
  return host;
}

// Whether a tag is that of a process of this machine that has ended.
bool isOfTheDead(const std::string& tag) {
  const std::size_t dash = tag.find('-');
  if (dash == std::string::npos || tag.substr(dash + 1) != hostName()) return false;
  const int process = std::atoi(tag.c_str());
  return process > 0 && kill(process, 0) != 0 && errno == ESRCH;
}

}  // namespace

bool isFile(const fs::path& path) {
  std::error_code ec;
  return fs::is_regular_file(path, ec);
}

bool isFolder(const fs::path& path) {
  std::error_code ec;
  return fs::is_directory(path, ec);
}

fs::path plainPath(const fs::path& path) {
  std::error_code ec;
  const fs::path whole = fs::absolute(path, ec);
  const fs::path plain = fs::weakly_canonical(whole, ec);
  return ec ? whole.lexically_normal() : plain;
}

std::string processTag() { return fmt::format("{}-{}", getpid(), hostName()); }

void removeLeftOvers(const fs::path& folder) {
  std::error_code ec;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ec)) {
    std::string name = entry.path().filename().string();
    if (!name.starts_with('.')) continue;
    const bool temporary = entry.path().stem().extension() == ".tmp";
    if (!temporary && entry.path().extension() != ".out") continue;
    name = entry.path().stem().string();  // .NAME.TAG or .NAME.TAG.tmp
    if (temporary) name = fs::path(name).stem().string();
    const std::size_t dot = name.rfind('.');
    if (dot > 0 && isOfTheDead(name.substr(dot + 1))) fs::remove(entry.path(), ec);
  }
}

std::vector<std::byte> readFile(const fs::path& path) {
  std::error_code ec;
  if (!fs::exists(path, ec)) throwInput("{}: no such file", path.string());
  if (fs::is_directory(path, ec)) throwInput("{}: is a folder, a file is needed", path.string());
  // /dev/zero has no end.
  if (fs::is_character_file(path, ec) || fs::is_block_file(path, ec))
    throwInput("{}: is a device, a file is needed", path.string());
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file && errno == EINTR) throwIfInterrupted();
  if (!file) throwInput("{}: cannot be read: {}", path.string(), std::strerror(errno));
  std::vector<std::byte> bytes;
  std::byte chunk[1 << 16];
  for (std::size_t n; (n = std::fread(chunk, 1, sizeof chunk, file.get())) > 0;)
    bytes.insert(bytes.end(), chunk, chunk + n);
  if (std::ferror(file.get()) && errno == EINTR) throwIfInterrupted();
  if (std::ferror(file.get()))
    throwInput("{}: cannot be read: {}", path.string(), std::strerror(errno));
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

void writeFileAtomically(const fs::path& wanted,
                         const std::function<void(const fs::path&)>& write) {
  std::error_code ec;
  const fs::path path = targetOf(wanted);
  refuseSpecialFile(path);
  const fs::path temporary = temporaryPath(path);
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
    const bool written =
        file && std::fwrite(text.data(), 1, text.size(), file.get()) == text.size();
    const bool closed = file && std::fclose(file.release()) == 0;
    if (!written || !closed)
      throw Error(fmt::format("{}: cannot be written: {}", path.string(), std::strerror(errno)));
  });
}

void checkWritable(const fs::path& wanted) {
  const fs::path path = targetOf(wanted);
  std::error_code ec;
  if (fs::is_directory(path, ec)) throwInput("{}: is a folder, name a file", path.string());
  refuseSpecialFile(path);
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ec))
    throwInput("{}: the folder {} does not exist; create it first", path.string(), folder.string());
  const fs::path probe = temporaryPath(path);
  const File file(std::fopen(probe.c_str(), "wb"));
  if (!file) throwInput("{}: cannot be written: {}", path.string(), std::strerror(errno));
  fs::remove(probe, ec);
}

}  // namespace probelab
