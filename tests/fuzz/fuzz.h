// SPDX-License-Identifier: GPL-3.0-or-later
// Harnesses for hostile files: one function a format, which gives bytes to the loader that the
// program uses. It returns for anything that is loaded or refused by an InputError; everything else
// (another exception, a failed check, a sanitizer's finding) ends the process.
//
// clang's libFuzzer drives them (scripts/fuzz, preset `fuzz`); replay.cpp runs them over the saved
// files in the ordinary tests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "base/error.h"
#include "scene/scene.h"

namespace probelab::fuzz {

using Bytes = std::span<const uint8_t>;

// A folder of this process with the files that scenes and studies of the corpus name, and the input
// in a file of this name.
std::filesystem::path inputFile(Bytes bytes, const std::string& name);
// tests/fuzz/corpus/glb/room.glb: what layouts and receivers of the corpus were made for.
const Scene& room();

// Runs a loader; InputError is the one way to refuse.
template <class Load>
void expectLoadedOrRefused(const Load& load) {
  try {
    load();
  } catch (const InputError&) {
  }
}

struct Format {
  const char* name;
  void (*run)(Bytes bytes);
};
std::span<const Format> formats();

void runGltf(Bytes bytes);
void runGlb(Bytes bytes);
void runExr(Bytes bytes);
void runPicture(Bytes bytes);
void runSceneToml(Bytes bytes);
void runParamsToml(Bytes bytes);
void runStudyToml(Bytes bytes);
void runLayoutJson(Bytes bytes);
void runReceiversJson(Bytes bytes);
void runPointsCsv(Bytes bytes);
void runValuesJson(Bytes bytes);

}  // namespace probelab::fuzz
