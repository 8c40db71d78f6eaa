// SPDX-License-Identifier: Apache-2.0
// Keeps a glTF file's URIs inside the file's own folder. Called by the glTF reader for every URI
// before anything is read, and again by tinygltf's file callbacks.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace probelab {

class FileGuard {
 public:
  // `scene_file`: the glTF or GLB file; its folder is the allowed one.
  explicit FileGuard(const std::filesystem::path& scene_file);

  // The file that a URI names, decoded and with symbolic links resolved (it need not exist). Throws
  // InputError naming the scene file and `element` when the URI is absolute, has a scheme, or leads
  // out of the folder, also through percent-encoding or a symbolic link.
  std::filesystem::path resolve(const std::string& uri, const std::string& element) const;

  // Lets tinygltf read what `uri` names; `path` is what `resolve` gave for it.
  void expect(const std::string& uri, const std::filesystem::path& path);

  // True for a path, as tinygltf joins it, that stands for an expected URI and is a regular file.
  bool allows(const std::string& path) const;

  // The bytes of a file that passed `allows`, cut to the declared length of a buffer; remembers
  // their hash. Throws InputError.
  std::vector<unsigned char> read(const std::string& path);

  // A buffer's file may be longer than the buffer.
  void declareLength(const std::filesystem::path& path, std::size_t bytes);

  const std::filesystem::path& folder() const { return folder_; }
  const std::vector<std::string>& hashes() const { return hashes_; }

 private:
  bool inFolder(const std::filesystem::path& path) const;

  std::string scene_file_;
  std::filesystem::path folder_;                           // canonical
  std::map<std::string, std::filesystem::path> expected_;  // by tinygltf's name for it
  std::map<std::filesystem::path, std::size_t> declared_;
  std::vector<std::string> hashes_;
};

}  // namespace probelab
