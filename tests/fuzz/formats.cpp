// SPDX-License-Identifier: GPL-3.0-or-later
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "fuzz.h"
#include "scene/load.h"

namespace probelab::fuzz {
namespace fs = std::filesystem;
namespace {

// Goes away with the process.
class WorkFolder {
 public:
  WorkFolder() {
    std::string name = (fs::temp_directory_path() / "probelab_fuzz.XXXXXX").string();
    if (!mkdtemp(name.data())) throw Error("no folder can be made for the harness");
    path_ = name;
    const fs::path corpus = fs::path(PROBELAB_FUZZ_FOLDER) / "corpus";
    for (const char* file : {"glb/room.glb", "scene_toml/room.toml", "exr/sky.exr",
                             "picture/rgba.png", "params_toml/rtxgi.toml"})
      fs::copy_file(corpus / file, path_ / fs::path(file).filename());
  }
  ~WorkFolder() {
    std::error_code ec;
    fs::remove_all(path_, ec);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

constexpr std::array<Format, 11> kFormats = {{{"gltf", runGltf},
                                              {"glb", runGlb},
                                              {"exr", runExr},
                                              {"picture", runPicture},
                                              {"scene_toml", runSceneToml},
                                              {"params_toml", runParamsToml},
                                              {"study_toml", runStudyToml},
                                              {"layout_json", runLayoutJson},
                                              {"receivers_json", runReceiversJson},
                                              {"points_csv", runPointsCsv},
                                              {"values_json", runValuesJson}}};

}  // namespace

fs::path inputFile(Bytes bytes, const std::string& name) {
  static const WorkFolder folder;
  const fs::path path = folder.path() / name;
  std::FILE* file = std::fopen(path.c_str(), "wb");
  const bool is_written =
      file && (bytes.empty() || std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size());
  if (!file || std::fclose(file) != 0 || !is_written)
    throw Error("the harness cannot write its input");
  return path;
}

const Scene& room() {
  static const Scene scene = loadScene(fs::path(PROBELAB_FUZZ_FOLDER) / "corpus/glb/room.glb");
  return scene;
}

std::span<const Format> formats() { return kFormats; }

}  // namespace probelab::fuzz
