// SPDX-License-Identifier: GPL-3.0-or-later
// Small glTF, GLB, PNG and EXR files from code, in a folder that goes away with its owner.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace probelab::test {

class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

void writeBytes(const std::filesystem::path& path, const std::string& bytes);
std::string base64(const std::string& bytes);

// 8-bit RGBA, row 0 first.
std::string pngFile(int width, int height, const std::vector<uint8_t>& rgba);

// A glTF in the making: `root` is free to be edited, `bin` is its only buffer.
class GltfBuilder {
 public:
  GltfBuilder();

  // Each returns the index of what it added.
  int view(const std::string& bytes, int stride = 0);
  int accessor(const std::string& bytes, int component_type, const char* type, std::size_t count,
               bool normalized = false);
  int floats(const char* type, const std::vector<float>& values);
  int indices(const std::vector<uint32_t>& values, int component_type = 5125);
  int mesh(const nlohmann::json& primitive, const std::string& name = "mesh");
  int node(const nlohmann::json& node);   // into the default scene
  int child(const nlohmann::json& node);  // not into it
  int material(const nlohmann::json& material);
  int texture(const std::string& png, const nlohmann::json& sampler = nullptr);
  int light(const nlohmann::json& light);  // KHR_lights_punctual
  // A mesh with one triangle and a node that shows it; returns the node.
  int triangle(const std::vector<float>& positions = {0, 0, 0, 1, 0, 0, 0, 1, 0},
               const nlohmann::json& node_extra = nlohmann::json::object(), int material = -1);

  nlohmann::json finished() const;                          // with the buffer's length filled in
  void writeGltf(const std::filesystem::path& path) const;  // and a .bin beside it
  std::string glb() const;
  void writeGlb(const std::filesystem::path& path) const;

  nlohmann::json root;
  std::string bin;
};

template <class T>
std::string bytesOf(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

// Where a matte white material is needed: {"pbrMetallicRoughness": {"metallicFactor": 0}}.
nlohmann::json matte();

// The scene, read from a GLB of it.
Scene loadGlb(const GltfBuilder& gltf);

// The message of the InputError that loading throws; a failed expectation if it throws none or if
// the message has more than one line.
std::string loadError(const std::filesystem::path& path);

// World position of a corner of a triangle.
Vec3d corner(const Scene& scene, std::size_t triangle, int corner);

// Whether some warning contains `text`.
bool warns(const Scene& scene, const std::string& text);

#define EXPECT_CONTAINS(text, part) \
  EXPECT_NE(std::string(text).find(part), std::string::npos) << (text)

#define EXPECT_VEC_NEAR(a, bx, by, bz, tolerance) \
  do {                                            \
    const auto& vec_ = (a);                       \
    EXPECT_NEAR(vec_.x, bx, tolerance);           \
    EXPECT_NEAR(vec_.y, by, tolerance);           \
    EXPECT_NEAR(vec_.z, bz, tolerance);           \
  } while (false)

}  // namespace probelab::test
