// SPDX-License-Identifier: GPL-3.0-or-later
// Damaged and malicious glTF files: one line that names file and element, and nothing read outside
// the scene's folder.
#include <cmath>
#include <filesystem>
#include <limits>

#include "scene/load.h"
#include "scene_files.h"

namespace probelab::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

// Loads `gltf` as a GLB and returns the error; the file's name must be in it.
std::string errorOf(const GltfBuilder& gltf) {
  const TemporaryFolder folder;
  gltf.writeGlb(folder / "bad.glb");
  const std::string error = loadError(folder / "bad.glb");
  EXPECT_CONTAINS(error, "bad.glb: ");
  return error;
}

std::string errorOfBytes(const std::string& bytes, const char* name = "bad.glb") {
  const TemporaryFolder folder;
  writeBytes(folder / name, bytes);
  const std::string error = loadError(folder / name);
  EXPECT_CONTAINS(error, name);
  return error;
}

// A triangle whose mesh, node and accessors are there to be spoilt.
GltfBuilder indexedTriangle(const std::vector<uint32_t>& indices = {0, 1, 2}) {
  GltfBuilder gltf;
  json primitive = {
      {"attributes", {{"POSITION", gltf.floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0})}}},
      {"indices", gltf.indices(indices, 5123)},
      {"material", gltf.material(matte())}};
  gltf.node({{"name", "chair"}, {"mesh", gltf.mesh(primitive, "seat")}});
  return gltf;
}

TEST(HostileGltf, MissingFilesFoldersAndOtherKindsAreRefused) {
  const TemporaryFolder folder;
  EXPECT_CONTAINS(loadError(folder / "none.glb"), "none.glb: no such file");
  fs::create_directory(folder / "dir.glb");
  EXPECT_CONTAINS(loadError(folder / "dir.glb"), "dir.glb: is a folder");
  writeBytes(folder / "model.obj", "v 0 0 0");
  EXPECT_CONTAINS(loadError(folder / "model.obj"), "model.obj: is no scene");
  writeBytes(folder / "empty.gltf", "");
  EXPECT_CONTAINS(loadError(folder / "empty.gltf"), "empty.gltf: is not valid JSON");
}

TEST(HostileGltf, EveryTruncationOfAGlbIsAnError) {
  const std::string whole = indexedTriangle().glb();
  for (std::size_t size = 0; size < whole.size(); ++size) errorOfBytes(whole.substr(0, size));
}

TEST(HostileGltf, EveryTruncationWithAMatchingHeaderIsAnError) {
  const std::string whole = indexedTriangle().glb();
  for (std::size_t size = 12; size < whole.size(); ++size) {
    std::string bytes = whole.substr(0, size);
    for (int i = 0; i < 4; ++i) bytes[8 + i] = static_cast<char>(size >> 8 * i);
    errorOfBytes(bytes);
  }
}

TEST(HostileGltf, FlippedBytesNeverCrash) {
  // Each byte of the file set to a few values: it loads or is refused in one line.
  const std::string whole = indexedTriangle().glb();
  const TemporaryFolder folder;
  for (std::size_t i = 0; i < whole.size(); ++i)
    for (const char value : {'\0', '\xff', '9', '"'}) {
      std::string bytes = whole;
      bytes[i] = value;
      writeBytes(folder / "bad.glb", bytes);
      try {
        loadScene(folder / "bad.glb");
      } catch (const std::exception& e) {
        EXPECT_CONTAINS(e.what(), "bad.glb");
        EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
      }
    }
}

TEST(HostileGltf, JsonThatIsNoneOrTooDeepIsRefused) {
  EXPECT_CONTAINS(errorOfBytes("{ \"asset\": ", "bad.gltf"), "is not valid JSON");
  EXPECT_CONTAINS(errorOfBytes("[1, 2]", "bad.gltf"), "is not an object");
  EXPECT_CONTAINS(errorOfBytes("{}", "bad.gltf"), "asset: is missing");
  EXPECT_CONTAINS(errorOfBytes(R"({"asset": {"version": "1.0"}})", "bad.gltf"), "version '1.0'");
  EXPECT_CONTAINS(errorOfBytes(R"({"asset": {"version": "2.0"}, "nodes": 7})", "bad.gltf"),
                  "nodes: must be an array");
  EXPECT_CONTAINS(
      errorOfBytes("{\"extras\": " + std::string(200000, '[') + std::string(200000, ']') + "}",
                   "bad.gltf"),
      "nested deeper than 64");
}

TEST(HostileGltf, NothingToShowIsAnErrorThatSaysWhatToDo) {
  EXPECT_CONTAINS(errorOfBytes(R"({"asset": {"version": "2.0"}})", "bad.gltf"), "no triangles");
}

TEST(HostileGltf, UrisThatLeaveTheFolderAreRefusedUnread) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "scene");
  fs::create_directory(folder / "scene/inside");
  GltfBuilder gltf = indexedTriangle();
  writeBytes(folder / "secret.bin", gltf.bin);
  writeBytes(folder / "scene/inside/fine.bin", gltf.bin);
  fs::create_symlink(folder / "secret.bin", folder / "scene/link.bin");
  fs::create_directory_symlink(folder.path(), folder / "scene/up");
  const auto load_with = [&](const char* kind, const std::string& uri) {
    GltfBuilder bad = gltf;
    bad.root["buffers"] = json::array({{{"byteLength", bad.bin.size()}}});
    bad.root["buffers"][0]["uri"] = kind == std::string("buffer") ? uri : "inside/fine.bin";
    if (kind == std::string("image")) bad.root["images"] = json::array({{{"uri", uri}}});
    writeBytes(folder / "scene/bad.gltf", bad.root.dump());
    return loadError(folder / "scene/bad.gltf");
  };
  const std::string absolute = (folder / "secret.bin").string();
  for (const std::string& uri :
       {std::string("../secret.bin"), std::string("inside/../../secret.bin"), absolute,
        "file://" + absolute, "file:" + absolute, std::string("%2e%2e/secret.bin"),
        std::string("..%2Fsecret.bin"), std::string("%252e%252e%252fsecret.bin"),
        std::string("..\\secret.bin"), std::string("C:/secret.bin"),
        std::string("http://example.org/secret.bin"), std::string("link.bin"),
        std::string("up/secret.bin"), std::string("inside/../up/secret.bin"), std::string("")})
    for (const char* kind : {"buffer", "image"}) {
      const std::string error = load_with(kind, uri);
      EXPECT_CONTAINS(error, std::string("bad.gltf: ") + kind + " 0: URI");
    }
}

TEST(HostileGltf, UrisInsideTheFolderAreRead) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "inside");
  GltfBuilder gltf = indexedTriangle();
  writeBytes(folder / "inside/my data.bin", gltf.bin + "padding");
  fs::create_symlink(folder / "inside/my data.bin", folder / "link.bin");
  writeBytes(folder / "a+b.bin", gltf.bin);
  for (const char* uri : {"inside/my data.bin", "inside/my%20data.bin", "a+b.bin",
                          "./inside/my data.bin", "inside/../inside/my data.bin", "link.bin"}) {
    gltf.root["buffers"] = json::array({{{"byteLength", gltf.bin.size()}, {"uri", uri}}});
    writeBytes(folder / "a.gltf", gltf.root.dump());
    EXPECT_EQ(loadScene(folder / "a.gltf").geometry->triangles.size(), 1u) << uri;
  }
}

TEST(HostileGltf, NoShellSeesAPath) {
  const TemporaryFolder folder;
  GltfBuilder gltf = indexedTriangle();
  const fs::path victim = folder / "created";
  for (const std::string& uri : {"`touch " + victim.string() + "`.bin", std::string("$HOME.bin"),
                                 "$(touch " + victim.string() + ").bin", std::string("~.bin")}) {
    gltf.root["buffers"] = json::array({{{"byteLength", gltf.bin.size()}, {"uri", uri}}});
    writeBytes(folder / "bad.gltf", gltf.root.dump());
    EXPECT_CONTAINS(loadError(folder / "bad.gltf"), "bad.gltf: buffer 0: ");
    EXPECT_FALSE(fs::exists(victim));
  }
}

TEST(HostileGltf, DataUrisMustHoldWhatTheySay) {
  const TemporaryFolder folder;
  GltfBuilder gltf = indexedTriangle();
  const std::string data = "data:application/octet-stream;base64," + base64(gltf.bin);
  gltf.root["buffers"] = json::array({{{"byteLength", gltf.bin.size()}, {"uri", data}}});
  writeBytes(folder / "a.gltf", gltf.root.dump());
  EXPECT_EQ(loadScene(folder / "a.gltf").geometry->triangles.size(), 1u);
  gltf.root["buffers"][0]["byteLength"] = gltf.bin.size() + 4;
  EXPECT_CONTAINS(errorOfBytes(gltf.root.dump(), "bad.gltf"), "buffer 0: byteLength is");
  gltf.root["buffers"][0]["uri"] = "data:text/html,hello";
  EXPECT_CONTAINS(errorOfBytes(gltf.root.dump(), "bad.gltf"), "buffer 0: 'data:text/html,hello'");
}

TEST(HostileGltf, BuffersShorterThanTheySayAreErrors) {
  GltfBuilder gltf = indexedTriangle();
  gltf.root["buffers"] = json::array({{{"byteLength", 4000}}});
  EXPECT_CONTAINS(errorOf(gltf), "buffer 0: byteLength is 4000");
  const TemporaryFolder folder;
  writeBytes(folder / "short.bin", gltf.bin.substr(0, 10));
  gltf.root["buffers"][0] = {{"byteLength", gltf.bin.size()}, {"uri", "short.bin"}};
  writeBytes(folder / "bad.gltf", gltf.root.dump());
  EXPECT_CONTAINS(loadError(folder / "bad.gltf"), "'short.bin' has 10 bytes");
  gltf.root["buffers"][0]["uri"] = "gone.bin";
  writeBytes(folder / "bad.gltf", gltf.root.dump());
  EXPECT_CONTAINS(loadError(folder / "bad.gltf"), "buffer 0: 'gone.bin': no such file");
}

TEST(HostileGltf, ViewsAndAccessorsThatOverrunAreErrors) {
  const auto with = [](const std::function<void(json&)>& spoil) {
    GltfBuilder gltf = indexedTriangle();
    spoil(gltf.root);
    return errorOf(gltf);
  };
  const uint64_t huge = 9007199254740991u;
  EXPECT_CONTAINS(with([](json& r) { r["bufferViews"][0]["byteLength"] = 4000; }), "buffer view 0");
  EXPECT_CONTAINS(with([&](json& r) { r["bufferViews"][0]["byteOffset"] = huge; }),
                  "buffer view 0");
  EXPECT_CONTAINS(with([](json& r) { r["bufferViews"][0]["byteStride"] = 3; }), "byteStride 3");
  EXPECT_CONTAINS(with([](json& r) { r["bufferViews"][0]["byteStride"] = 4; }),
                  "node 'chair', mesh 'seat', primitive 0, POSITION: accessor 0 has elements");
  EXPECT_CONTAINS(with([](json& r) { r["accessors"][0]["count"] = 4; }),
                  "mesh 'seat', primitive 0, POSITION: accessor 0 runs past");
  EXPECT_CONTAINS(with([&](json& r) { r["accessors"][0]["count"] = huge; }),
                  "accessor 0 runs past");
  EXPECT_CONTAINS(with([&](json& r) { r["accessors"][0]["byteOffset"] = huge; }), "runs past");
  EXPECT_CONTAINS(with([](json& r) { r["accessors"][0]["byteOffset"] = 4; }), "runs past");
  EXPECT_CONTAINS(with([&](json& r) {
                    r["accessors"][0].erase("bufferView");
                    r["accessors"][0]["count"] = huge;
                  }),
                  "and no data");
  EXPECT_CONTAINS(with([](json& r) { r["accessors"][0]["count"] = -3; }), "accessors[0].count");
  EXPECT_CONTAINS(with([](json& r) { r["accessors"][0]["count"] = 3.5; }), "accessors[0].count");
  EXPECT_CONTAINS(with([](json& r) { r["accessors"][0]["bufferView"] = 9; }),
                  "accessors[0].bufferView: is 9, but there are 2 bufferViews");
  EXPECT_CONTAINS(with([](json& r) { r["accessors"][0]["type"] = "VEC2"; }), "3 are needed");
  EXPECT_CONTAINS(with([](json& r) { r["accessors"][1]["componentType"] = 5126; }), "indices");
  EXPECT_CONTAINS(with([](json& r) {
                    r["accessors"][0]["sparse"] = {
                        {"count", 1},
                        {"indices", {{"bufferView", 1}, {"componentType", 5123}}},
                        {"values", {{"bufferView", 0}, {"byteOffset", 30}}}};
                  }),
                  "accessor 0 runs past");
  EXPECT_CONTAINS(
      with([](json& r) {
        r["accessors"][0]["sparse"] = {
            {"count", 1},
            {"indices", {{"bufferView", 0}, {"byteOffset", 14}, {"componentType", 5123}}},
            {"values", {{"bufferView", 0}}}};
      }),
      "accessor 0 has sparse index 16256");
}

TEST(HostileGltf, ReferencesToNothingAreErrors) {
  const auto with = [](const std::function<void(json&)>& spoil) {
    GltfBuilder gltf = indexedTriangle();
    spoil(gltf.root);
    return errorOf(gltf);
  };
  EXPECT_CONTAINS(with([](json& r) { r["nodes"][0]["mesh"] = 1; }), "nodes[0].mesh");
  EXPECT_CONTAINS(with([](json& r) { r["scenes"][0]["nodes"] = {5}; }), "scenes[0].nodes[0]");
  EXPECT_CONTAINS(with([](json& r) { r["scene"] = 2; }), "scene: is 2");
  EXPECT_CONTAINS(with([](json& r) { r["nodes"][0]["children"] = {4294967296u}; }), "children[0]");
  EXPECT_CONTAINS(with([](json& r) { r["meshes"][0]["primitives"][0]["indices"] = 7; }),
                  "meshes[0].primitives[0].indices");
  EXPECT_CONTAINS(with([](json& r) { r["meshes"][0]["primitives"][0]["material"] = -1; }),
                  "meshes[0].primitives[0].material");
  EXPECT_CONTAINS(
      with([](json& r) { r["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 9; }),
      "attributes.NORMAL");
  EXPECT_CONTAINS(with([](json& r) { r["meshes"][0]["primitives"][0]["mode"] = 9; }), "mode 9");
  EXPECT_CONTAINS(with([](json& r) { r["meshes"][0].erase("primitives"); }),
                  "meshes[0].primitives: is missing");
  EXPECT_CONTAINS(
      with([](json& r) { r["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 0; }),
      "nodes[0].extensions.KHR_lights_punctual.light");
}

TEST(HostileGltf, BadIndicesAndVerticesAreErrors) {
  EXPECT_CONTAINS(errorOf(indexedTriangle({0, 1, 3})),
                  "node 'chair', mesh 'seat', primitive 0: index 3 at 2 is out of range");
  EXPECT_CONTAINS(errorOf(indexedTriangle({0, 1, 65535})), "index 65535");
  EXPECT_CONTAINS(errorOf(indexedTriangle({0, 1, 2, 0})), "4 corners");
  for (const float bad : {kNan, kInf, -kInf}) {
    GltfBuilder gltf;
    gltf.triangle({0, 0, 0, 1, 0, 0, 0, bad, 0}, {{"name", "chair"}});
    EXPECT_CONTAINS(errorOf(gltf),
                    "node 'chair', mesh 'mesh', primitive 0, POSITION: accessor 0 "
                    "has a value that is not finite at element 2");
  }
  GltfBuilder far;
  far.triangle({0, 0, 0, 1, 0, 0, 0, 2e7f, 0}, {{"name", "chair"}});
  EXPECT_CONTAINS(errorOf(far), "node 'chair', mesh 'mesh', primitive 0: vertex 2 lies at");
  GltfBuilder moved;
  moved.triangle({0, 0, 0, 1, 0, 0, 0, 1, 0}, {{"translation", {0, 0, -1e8}}});
  EXPECT_CONTAINS(errorOf(moved), "beyond 10000000");
}

TEST(HostileGltf, AttributesOfAnotherLengthAreErrors) {
  GltfBuilder gltf = indexedTriangle();
  gltf.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      gltf.floats("VEC3", {0, 0, 1, 0, 0, 1});
  EXPECT_CONTAINS(errorOf(gltf), "has 2 values of NORMAL for 3 positions");
}

TEST(HostileGltf, NodeCyclesAndTwoParentsAreErrors) {
  GltfBuilder gltf = indexedTriangle();
  gltf.node({{"name", "a"}, {"children", {2}}});
  gltf.child({{"name", "b"}, {"children", {1}}});
  EXPECT_CONTAINS(errorOf(gltf), "node 'a': is reached twice");
  GltfBuilder self = indexedTriangle();
  self.root["nodes"][0]["children"] = {0};
  EXPECT_CONTAINS(errorOf(self), "node 'chair': is reached twice");
  GltfBuilder twice = indexedTriangle();
  twice.root["scenes"][0]["nodes"] = {0, 0};
  EXPECT_CONTAINS(errorOf(twice), "node 'chair': is reached twice");
}

TEST(HostileGltf, AHundredThousandNodesInARowLoad) {
  GltfBuilder gltf;
  gltf.triangle();
  const int depth = 100000;
  json nodes = json::array({gltf.root["nodes"][0]});
  for (int i = 1; i <= depth; ++i)
    nodes.push_back({{"children", {i == depth ? 0 : i + 1}}, {"translation", {0.001, 0, 0}}});
  gltf.root["nodes"] = nodes;
  gltf.root["scenes"][0]["nodes"] = {1};
  const TemporaryFolder folder;
  gltf.writeGlb(folder / "deep.glb");
  // 1e5 additions of 1e-3: each rounds by at most 2^-53 of 100.
  EXPECT_NEAR(corner(loadScene(folder / "deep.glb"), 0, 0).x, 100, 1e-7);
}

TEST(HostileGltf, TransformsThatCannotBeAreErrors) {
  const auto with = [](const char* key, const json& value) {
    GltfBuilder gltf;
    gltf.triangle({0, 0, 0, 1, 0, 0, 0, 1, 0}, {{"name", "chair"}, {key, value}});
    return errorOf(gltf);
  };
  EXPECT_CONTAINS(with("scale", {1, 0, 1}), "node 'chair': its local transform is singular");
  EXPECT_CONTAINS(with("scale", {1, 1e308, 1e308}), "node 'chair': its local transform is");
  EXPECT_CONTAINS(with("rotation", {0, 0, 0, 0}),
                  "node 'chair': its local transform is not finite");
  EXPECT_CONTAINS(with("translation", {0, 0}), "nodes[0].translation: must be 3 numbers");
  EXPECT_CONTAINS(with("translation", {0, nullptr, 0}), "nodes[0].translation: must be 3 numbers");
  EXPECT_CONTAINS(with("matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2}),
                  "node 'chair': its local transform is not affine");
  EXPECT_CONTAINS(with("matrix", {1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}), "singular");
}

TEST(HostileGltf, ExtensionsThatMatterAreRefusedByName) {
  GltfBuilder unknown = indexedTriangle();
  unknown.root["extensionsRequired"] = {"ACME_new_shapes"};
  EXPECT_CONTAINS(errorOf(unknown), "requires the extension ACME_new_shapes");
  for (const char* name : {"KHR_draco_mesh_compression", "EXT_meshopt_compression"}) {
    GltfBuilder compressed = indexedTriangle();
    compressed.root["extensionsUsed"] = {name};
    EXPECT_CONTAINS(errorOf(compressed), std::string("geometry is compressed (") + name);
  }
}

TEST(HostileGltf, NamesCannotBreakTheLine) {
  GltfBuilder gltf;
  gltf.triangle({0, 0, 0, 1, 0, 0, 0, kNan, 0}, {{"name", "a\nb\x1b[31m"}});
  EXPECT_CONTAINS(errorOf(gltf), "node 'a?b?[31m'");
}

}  // namespace
}  // namespace probelab::test
