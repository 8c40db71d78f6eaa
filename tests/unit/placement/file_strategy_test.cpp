// SPDX-License-Identifier: GPL-3.0-or-later
// Probes from files: what is read, and what is said about files that cannot be.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "ddgi/layout_file.h"
#include "places.h"

namespace probelab::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// A folder of its own for each test.
class FileStrategy : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(testing::TempDir()) /
        ("probelab_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return (folder_ / name).string();
  }
  ProbeLayout place(const std::string& path, int probes = 100) {
    return placeProbes("file", room_.input(probes, 1, {{"path", path}}));
  }
  // Of the InputError, which must name the file.
  std::string errorOf(const std::string& path, int probes = 100) {
    try {
      place(path, probes);
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find(path), std::string::npos) << e.what();
      return e.what();
    }
    return "nothing thrown";
  }
  void expectError(const std::string& path, const std::string& part, int probes = 100) {
    const std::string error = errorOf(path, probes);
    EXPECT_NE(error.find(part), std::string::npos) << error;
  }

  Place room_{pillarRoom()};
  fs::path folder_;
};

std::string glb(const Json& root, const std::string& binary) {
  std::string json = root.dump();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string bytes = "glTF";
  const auto add = [&](std::size_t value) {
    const auto v = static_cast<uint32_t>(value);
    bytes.append(reinterpret_cast<const char*>(&v), 4);
  };
  add(2), add(12 + 8 + json.size() + 8 + binary.size());
  add(json.size()), add(0x4E4F534A);
  bytes += json;
  add(binary.size()), add(0x004E4942);
  return bytes + binary;
}

Json nodeScene(Json nodes) {
  Json roots = Json::array();
  for (std::size_t i = 0; i < nodes.size(); ++i) roots.push_back(i);
  return {{"asset", {{"version", "2.0"}}},
          {"scene", 0},
          {"scenes", Json::array({{{"nodes", roots}}})},
          {"nodes", std::move(nodes)}};
}

// One mesh of two POINTS, moved by its node.
Json pointScene(const Json& buffer) {
  Json root = nodeScene(Json::array({{{"mesh", 0}, {"translation", {0.5, 0, 0}}}}));
  root["meshes"] = Json::array(
      {{{"primitives", Json::array({{{"mode", 0}, {"attributes", {{"POSITION", 0}}}}})}}});
  root["accessors"] =
      Json::array({{{"bufferView", 0}, {"componentType", 5126}, {"count", 2}, {"type", "VEC3"}}});
  root["bufferViews"] = Json::array({{{"buffer", 0}, {"byteLength", 24}}});
  root["buffers"] = Json::array({buffer});
  return root;
}

std::string twoPoints() {
  const float p[6] = {0.5f, 1, 1, 3, 1, 4};
  return {reinterpret_cast<const char*>(p), sizeof(p)};
}

TEST_F(FileStrategy, ReadsCsvWithHeaderCommentsAndPins) {
  const ProbeLayout layout =
      place(write("p.csv", "x,y,z,pinned\n# a comment\n\n1,1,1,1\r\n 3 , 1.5,4,0\n"));
  ASSERT_EQ(layout.positions.size(), 2u);
  EXPECT_EQ(layout.positions[1], Vec3f(3, 1.5f, 4));
  EXPECT_EQ(layout.pinned, (std::vector<uint8_t>{1, 0}));
  EXPECT_TRUE(place(write("q.csv", "1,1,1")).pinned.empty());
  // A spreadsheet's byte order mark.
  EXPECT_EQ(place(write("r.csv", "\xEF\xBB\xBF" "x,y,z\n1,1,1\n")).positions.size(), 1u);
}

TEST_F(FileStrategy, ReadsNodesThroughTheirParents) {
  // A parent turned by 90 degrees about y and scaled by 2: (x, y, z) -> 2 (z, y, -x).
  const double r = std::sqrt(0.5);
  Json root = nodeScene(Json::array(
      {{{"name", "all"},
        {"children", {1, 2}},
        {"translation", {1, 0, 1}},
        {"rotation", {0, r, 0, r}},
        {"scale", {2, 2, 2}}},
       {{"name", "probe 0"}, {"translation", {-0.5, 0.5, 0}}, {"extras", {{"pinned", true}}}},
       {{"name", "lamp"}, {"translation", {9, 9, 9}}}}));
  root["scenes"][0]["nodes"] = {0};
  const ProbeLayout layout = place(write("p.gltf", root.dump()));
  ASSERT_EQ(layout.positions.size(), 1u);
  EXPECT_LT(length(layout.positions[0] - Vec3f(1, 1, 2)), 1e-6f);
  EXPECT_EQ(layout.pinned, std::vector<uint8_t>{1});
}

TEST_F(FileStrategy, ReadsPointsFromGlbDataUriAndFile) {
  const std::vector<Vec3f> expected = {{1, 1, 1}, {3.5f, 1, 4}};
  EXPECT_EQ(place(write("a.glb", glb(pointScene({{"byteLength", 24}}), twoPoints()))).positions,
            expected);
  write("points.bin", twoPoints());
  EXPECT_EQ(place(write("b.gltf", pointScene({{"byteLength", 24}, {"uri", "points.bin"}}).dump()))
                .positions,
            expected);
  // 0.5, 1, 1, 3, 1, 4 as little-endian floats.
  const std::string uri = "data:application/octet-stream;base64,AAAAPwAAgD8AAIA/AABAQAAAgD8AAIBA";
  EXPECT_EQ(place(write("c.gltf", pointScene({{"byteLength", 24}, {"uri", uri}}).dump())).positions,
            expected);
}

TEST_F(FileStrategy, NodesAreProbesByTheWholeWord) {
  const auto named = [&](const char* name) {
    const Json node = {{"name", name}, {"translation", {1, 1, 1}}};
    return write("p.gltf", nodeScene(Json::array({node})).dump());
  };
  for (const char* name : {"probe", "probe 12", "probe.001", "probe_2"})
    EXPECT_EQ(place(named(name)).positions.size(), 1u) << name;
  for (const char* name : {"probes", "probelab", "Probe"}) expectError(named(name), "no probes");
}

TEST_F(FileStrategy, KeepsALayoutsOwnWeights) {
  writeLayout(folder_ / "l.json", placeProbes("poisson", room_.input(20)), room_.scene);
  const std::string path = (folder_ / "l.json").string();
  EXPECT_EQ(place(path).options, (OptionValues{{"path", path}}));
  PlacementInput input = room_.input(100, 1, {{"path", path}, {"interpolant", "maxent"}});
  input.given = {"path", "interpolant"};
  EXPECT_THROW(placeProbes("file", input), InputError);
}

TEST_F(FileStrategy, ReadsALayoutBack) {
  const ProbeLayout poisson = placeProbes("poisson", room_.input(20));
  writeLayout(folder_ / "l.json", poisson, room_.scene);
  const ProbeLayout layout = place((folder_ / "l.json").string());
  EXPECT_EQ(layout.positions, poisson.positions);
  EXPECT_EQ(layout.strategy, "file");
}

TEST_F(FileStrategy, SaysWhichProbeIsWhereNoneMayBe) {
  expectError(write("a.csv", "1,1,1\n2,1,2.5\n"), "probe 1 at (2, 1, 2.5) lies inside solid");
  expectError(write("b.csv", "1,1,1\n1,2,1\n1,50,1\n"), "probe 2 at (1, 50, 1) lies outside");
  expectError(write("c.csv", "1,1,1\n1,2,1\n"), "2 probes, the budget is 1", 1);
  EXPECT_EQ(place(write("d.csv", "1,1,1\n1,2,1\n"), 2).positions.size(), 2u);
}

TEST_F(FileStrategy, SaysWhatIsWrongWithAFile) {
  EXPECT_THROW(placeProbes("file", room_.input(8)), InputError);
  expectError((folder_ / "missing.csv").string(), "");
  expectError(write("a.obj", ""), "layout .json");
  expectError(write("a.csv", ""), "no probes");
  for (const char* line : {"1,2", "1,2,x", "1,2,nan", "1,2,3,2", "1,2,3,1,1", "1e999,0,0", ",,"})
    expectError(write("b.csv", std::string("1,1,1\n") + line + "\n"), "line 2");
  expectError(write("a.gltf", "{"), "JSON");
  expectError(write("b.gltf", "[]"), "JSON");
  expectError(write("a.glb", "glTF"), "GLB");
  expectError(write("c.gltf", R"({"nodes": []})"), "no scene");
  expectError(write("d.gltf", nodeScene(Json::array({{{"name", "lamp"}}})).dump()), "no probes");
}

TEST_F(FileStrategy, SurvivesHostileGltf) {
  Json looped = nodeScene(Json::array({{{"name", "probe"}, {"children", {0}}}}));
  expectError(write("a.gltf", looped.dump()), "node 0");
  Json far = nodeScene(Json::array({{{"name", "probe"}, {"children", {7}}}}));
  expectError(write("b.gltf", far.dump()), "not there");
  Json text = nodeScene(Json::array({{{"name", "probe"}, {"translation", {1, "2", 3}}}}));
  expectError(write("c.gltf", text.dump()), "translation");
  const std::string huge = R"({"scenes":[{"nodes":[0]}],"nodes":[{"name":"probe",)"
                           R"("translation":[1e308,0,0],"scale":[1e308,1,1]}]})";
  EXPECT_NE(errorOf(write("d.gltf", huge)), "nothing thrown");
  Json root = pointScene({{"byteLength", 24}});
  root["accessors"][0]["count"] = 3;
  expectError(write("e.glb", glb(root, twoPoints())), "beyond");
  root["accessors"][0]["count"] = 2;
  root["bufferViews"][0]["byteLength"] = 12;
  expectError(write("k.glb", glb(root, twoPoints())), "beyond its bufferView");
  root["bufferViews"][0]["byteLength"] = 24;
  root["accessors"][0]["count"] = -3;
  expectError(write("f.glb", glb(root, twoPoints())), "count");
  root["accessors"][0]["count"] = 2;
  root["bufferViews"][0]["byteOffset"] = uint64_t{1} << 39;
  expectError(write("g.glb", glb(root, twoPoints())), "beyond");
  root["bufferViews"][0]["byteOffset"] = 0;
  root["bufferViews"][0]["byteStride"] = 4;
  expectError(write("h.glb", glb(root, twoPoints())), "beyond");
  for (const char* uri : {"../secret", "/etc/passwd", "http://x/y", "..", "data:,x"})
    EXPECT_NE(errorOf(write("i.gltf", pointScene({{"byteLength", 24}, {"uri", uri}}).dump())),
              "nothing thrown");
  std::string cut = glb(pointScene({{"byteLength", 24}}), twoPoints());
  for (const std::size_t bytes : {4u, 19u, 25u, 300u})
    EXPECT_NE(errorOf(write("j.glb", cut.substr(0, bytes))), "nothing thrown");
}

}  // namespace
}  // namespace probelab::test
