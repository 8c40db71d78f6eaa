// SPDX-License-Identifier: GPL-3.0-or-later
// Damaged and malicious files: an error in one line that names what is wrong, nothing else.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "cases.h"
#include "hostile_files.h"
#include "image/exr.h"
#include "scene/load.h"

namespace probelab {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string bytesOf(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// A glTF beside its buffer, whose URI is `uri`.
Measurement refusedUri(Workbench& bench, const std::string& uri, const char* kind,
                       const std::vector<std::string>& parts) {
  const fs::path folder = bench.folder() / "scene";
  fs::create_directories(folder);
  TinyGltf gltf;
  writeBytes(bench.folder() / "secret.bin", gltf.bin);
  writeBytes(folder / "fine.bin", gltf.bin);
  std::error_code ignored;
  fs::create_symlink(bench.folder() / "secret.bin", folder / "link.bin", ignored);
  gltf.root["buffers"][0]["uri"] = kind == std::string("buffer") ? uri : "fine.bin";
  if (kind == std::string("image")) {
    gltf.root["images"] = json::array({{{"uri", uri}}});
    gltf.root["textures"] = json::array({{{"source", 0}}});
    gltf.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  }
  writeBytes(folder / "bad.gltf", gltf.root.dump());
  return refused([&] { loadScene(folder / "bad.gltf"); }, parts);
}

// Every one refused; the last one's message, or the first that was not.
template <class List, class Check>
Measurement allRefused(const List& list, const Check& check) {
  Measurement result = checked(false, "nothing tried");
  std::size_t tried = 0;
  for (const auto& item : list) {
    result = check(item);
    if (result.verdict != Verdict::holds) return result;
    ++tried;
  }
  result.text = fmt::format("{} refused; {}", tried, result.text);
  return result;
}

Measurement truncatedGlb(Workbench& bench, const CaseVariant&) {
  const std::string whole = TinyGltf().glb();
  loadTiny(bench, TinyGltf());
  std::vector<std::size_t> sizes;
  for (std::size_t size = 0; size < whole.size(); size += 7) sizes.push_back(size);
  return allRefused(sizes, [&](std::size_t size) {
    writeBytes(bench.folder() / "bad.glb", whole.substr(0, size));
    return refused([&] { loadScene(bench.folder() / "bad.glb"); }, {"bad.glb"});
  });
}

Measurement lyingBuffers(Workbench& bench, const CaseVariant&) {
  const uint64_t huge = 9007199254740991u;
  using Damage = std::function<void(json&)>;
  const std::vector<std::pair<const char*, Damage>> damages{
      {"buffer", [](json& r) { r["buffers"][0]["byteLength"] = 4000000000u; }},
      {"buffer view", [](json& r) { r["bufferViews"][0]["byteLength"] = 4000; }},
      {"buffer view", [=](json& r) { r["bufferViews"][0]["byteOffset"] = huge; }},
      {"stride", [](json& r) { r["bufferViews"][0]["byteStride"] = 4; }},
      {"accessor", [](json& r) { r["accessors"][0]["count"] = 4; }},
      {"accessor", [=](json& r) { r["accessors"][0]["count"] = huge; }},
      {"accessor", [=](json& r) { r["accessors"][0]["byteOffset"] = huge; }},
      {"accessor",
       [=](json& r) { r["accessors"][0].erase("bufferView"), r["accessors"][0]["count"] = huge; }},
      {"accessor", [](json& r) { r["accessors"][0]["count"] = -3; }}};
  loadTiny(bench, TinyGltf());
  return allRefused(damages, [&](const auto& damage) {
    return refusedGltf(bench, [&](TinyGltf& g) { damage.second(g.root); },
                       {"tiny.glb", damage.first});
  });
}

Measurement missingFiles(Workbench& bench, const CaseVariant&) {
  return both(refusedUri(bench, "gone.bin", "buffer", {"gone.bin", "no such file"}),
              refusedUri(bench, "gone.png", "image", {"gone.png"}));
}

Measurement traversal(Workbench& bench, const CaseVariant&) {
  const std::string absolute = (bench.folder() / "secret.bin").string();
  const std::vector<std::string> uris{
      "../secret.bin",      "a/../../secret.bin", absolute,
      "file://" + absolute, "..%2Fsecret.bin",    "%2e%2e/secret.bin",
      "..\\secret.bin",     "link.bin",           "http://example.org/secret.bin"};
  return allRefused(uris, [&](const std::string& uri) {
    const Measurement image = refusedUri(bench, uri, "image", {"image 0", "URI"});
    if (image.verdict != Verdict::holds) return image;
    return refusedUri(bench, uri, "buffer", {"buffer 0", "URI"});
  });
}

Measurement noShell(Workbench& bench, const CaseVariant&) {
  const fs::path victim = bench.folder() / "created";
  const std::vector<std::string> uris{"`touch " + victim.string() + "`.bin",
                                      "$(touch " + victim.string() + ").bin", "$HOME.bin", "~.bin"};
  const Measurement all = allRefused(
      uris, [&](const std::string& uri) { return refusedUri(bench, uri, "buffer", {"buffer 0"}); });
  return both(all, checked(!fs::exists(victim), "no command ran"));
}

Measurement nodeCycles(Workbench& bench, const CaseVariant&) {
  return both(
      refusedGltf(bench, [](TinyGltf& g) { g.root["nodes"][0]["children"] = json::array({0}); },
                  {"node 'chair'", "reached twice"}),
      refusedGltf(bench,
                  [](TinyGltf& g) {
                    g.root["scenes"][0]["nodes"] = json::array({0, 0});
                  },
                  {"reached twice"}));
}

Measurement deepNodes(Workbench& bench, const CaseVariant&) {
  TinyGltf gltf;
  constexpr int kDepth = 100000;
  json nodes = json::array({gltf.root["nodes"][0]});
  for (int i = 1; i <= kDepth; ++i)
    nodes.push_back({{"children", json::array({i == kDepth ? 0 : i + 1})}});
  gltf.root["nodes"] = std::move(nodes);
  gltf.root["scenes"][0]["nodes"] = json::array({1});
  const std::size_t triangles = loadTiny(bench, gltf).geometry->triangles.size();
  return both(
      checked(triangles == 1, "100,000 nodes in a row load"),
      refused(
          [&] {
            writeBytes(bench.folder() / "deep.gltf",
                       "{\"extras\": " + std::string(200000, '[') + std::string(200000, ']') + "}");
            loadScene(bench.folder() / "deep.gltf");
          },
          {"nested deeper"}));
}

Measurement badTransforms(Workbench& bench, const CaseVariant&) {
  const std::vector<std::pair<const char*, json>> transforms{
      {"scale", {1, 0, 1}},
      {"scale", {1, 1e308, 1e308}},
      {"rotation", {0, 0, 0, 0}},
      {"translation", {0, nullptr, 0}},
      {"matrix", {1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}},
      {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2}}};
  loadTiny(bench, TinyGltf());
  return allRefused(transforms, [&](const auto& transform) {
    return refusedGltf(bench,
                       [&](TinyGltf& g) { g.root["nodes"][0][transform.first] = transform.second; },
                       {"tiny.glb", "node"});
  });
}

// Offset just behind an attribute's name, type and size in an EXR header.
std::size_t attributeAt(const std::string& bytes, const std::string& name,
                        const std::string& type) {
  const std::string key = name + '\0' + type + '\0';
  const std::size_t at = bytes.find(key);
  if (at == std::string::npos) throw Error("the EXR has no attribute " + name);
  return at + key.size() + 4;
}

std::string tinyExr(Workbench& bench) {
  ImageFile file;
  file.layers[""] = imageFromPixels(4, 2, std::vector<Vec3f>(8, Vec3f(0.5f)));
  writeExr(bench.folder() / "sky.exr", file);
  return bytesOf(bench.folder() / "sky.exr");
}

// Read as an image and as a scene's sky.
Measurement refusedExr(Workbench& bench, const std::string& bytes) {
  writeBytes(bench.folder() / "bad.exr", bytes);
  writeBytes(bench.folder() / "sky.toml",
             "[sky]\nimage = \"bad.exr\"\n[volume]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\n");
  const Measurement image = refused([&] { readExr(bench.folder() / "bad.exr"); }, {"bad.exr"});
  if (image.verdict != Verdict::holds) return image;
  return refused([&] { loadScene(bench.folder() / "sky.toml"); }, {"bad.exr"});
}

Measurement truncatedExr(Workbench& bench, const CaseVariant&) {
  const std::string whole = tinyExr(bench);
  std::vector<std::size_t> sizes;
  for (std::size_t size = 0; size < whole.size(); size += 23) sizes.push_back(size);
  return allRefused(sizes,
                    [&](std::size_t size) { return refusedExr(bench, whole.substr(0, size)); });
}

Measurement hugeExr(Workbench& bench, const CaseVariant&) {
  const std::string whole = tinyExr(bench);
  std::vector<std::string> files;
  std::string wide = whole;  // max.x = 2^31 - 2
  wide.replace(attributeAt(whole, "dataWindow", "box2i") + 8, 4,
               std::string("\xfe\xff\xff\x7f", 4));
  std::string tall = whole;
  tall.replace(attributeAt(whole, "dataWindow", "box2i") + 12, 4,
               std::string("\xfe\xff\xff\x7f", 4));
  std::string inside_out = whole;  // min.x = 100
  inside_out.replace(attributeAt(whole, "dataWindow", "box2i"), 4, std::string("\x64\0\0\0", 4));
  std::string bare = whole;  // an empty list of channels
  bare[attributeAt(whole, "channels", "chlist")] = '\0';
  for (const std::string& file : {wide, tall, inside_out, bare}) files.push_back(file);
  return allRefused(files, [&](const std::string& file) { return refusedExr(bench, file); });
}

Measurement badNumbers(Workbench& bench, const CaseVariant&) {
  const std::string point = "[[light]]\nname = \"l\"\ntype = \"point\"\n";
  const std::string sun = "[[light]]\nname = \"l\"\ntype = \"directional\"\nintensity = 1\n";
  const std::vector<std::pair<const char*, std::string>> tables{
      {"radiance", "[sky]\nradiance = [nan, 0, 0]\n"},
      {"radiance", "[sky]\nradiance = [-1, 0, 0]\n"},
      {"linear", "[sky]\nradiance = [1, 1, 1]\nlinear = [2, 0, 0]\n"},
      {"intensity", point + "intensity = inf\nposition = [0, 0, 0]\n"},
      {"position", point + "intensity = 1\nposition = [nan, 0, 0]\n"},
      {"direction", sun + "direction = [0, 0, 0]\n"}};
  const auto load = [&](const std::string& table) {
    writeBytes(bench.folder() / "bad.toml", table + "[volume]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\n");
    loadScene(bench.folder() / "bad.toml");
  };
  load("[sky]\nradiance = [1, 1, 1]\nlinear = [0.5, 0, 0]\n");
  load(point + "intensity = 1\nposition = [0, 0, 0]\n" + "[sky]\nradiance = [0, 0, 0]\n");
  return allRefused(tables, [&](const auto& table) {
    return refused([&] { load(table.second); }, {"bad.toml", table.first});
  });
}

Measurement unknownExtension(Workbench& bench, const CaseVariant&) {
  return refusedGltf(
      bench, [](TinyGltf& g) { g.root["extensionsRequired"] = json::array({"ACME_new_shapes"}); },
      {"ACME_new_shapes"});
}

}  // namespace

std::vector<StabilityCase> fileCases() {
  return {
      {"files.truncated_glb",
       "a GLB cut short, every seventh byte",
       "error naming the file",
       "G44",
       {},
       truncatedGlb},
      {"files.lying_buffers",
       "lengths, offsets, counts beyond the data, products that overflow",
       "error naming buffer, view or accessor; fuzzing bounds what is allocated",
       "G44",
       {},
       lyingBuffers},
      {"files.truncated_exr",
       "an EXR cut short, every 23rd byte",
       "error naming the file",
       "G44",
       {},
       truncatedExr},
      {"files.missing",
       "missing buffer and image",
       "error naming the URI",
       "G45",
       {},
       missingFiles},
      {"files.traversal",
       "URIs out of the folder: .., absolute, file:, encoded, links",
       "refused, unread",
       "G46",
       {},
       traversal},
      {"files.no_shell",
       "backticks and $() in URIs",
       "refused; no command runs",
       "G46",
       {},
       noShell},
      {"files.node_cycle",
       "nodes that are their own children, or a child twice",
       "error naming the node",
       "G47",
       {},
       nodeCycles},
      {"files.deep_nodes",
       "nodes 100,000 deep, JSON 200,000 deep",
       "loads; error",
       "G47",
       {},
       deepNodes},
      {"files.bad_transforms",
       "singular, infinite and NaN transforms",
       "error naming the node",
       "G47",
       {},
       badTransforms},
      {"files.huge_exr",
       "dataWindow of 2^31, inside out; no channels",
       "error naming the file; fuzzing bounds what is allocated",
       "G48",
       {},
       hugeExr},
      {"files.bad_numbers",
       "NaN, infinite, negative lights and skies",
       "error naming the file",
       "G49",
       {},
       badNumbers},
      {"files.unknown_extension",
       "an extension that is required and unknown",
       "error naming it",
       "G49",
       {},
       unknownExtension},
  };
}

}  // namespace probelab
