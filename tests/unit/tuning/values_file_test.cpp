// SPDX-License-Identifier: GPL-3.0-or-later
// Files of fitted values: what is written comes back, what is damaged or belongs elsewhere is said,
// and gains land on the texels that they were made for.
#include "tuning/values_file.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "base/files.h"
#include "field_helpers.h"

namespace probelab {
namespace {

class ValuesFile : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = std::filesystem::path(::testing::TempDir()) /
            fmt::format("values_{}.json",
                        ::testing::UnitTest::GetInstance()->current_test_info()->name());
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::filesystem::path path_;
};

// Two probes of 2 x 2 texels; the second one as traced.
TexelValues smallValues() {
  TexelValues values{.scene = "a/scene.toml",
                     .state = "west",
                     .params = "probelab rays=64",
                     .probes_hash = "00112233445566778899aabbccddeeff",
                     .texels = 2,
                     .gains = std::vector<Vec3f>(8, Vec3f(1))};
  values.gains[0] = Vec3f(0, 1e-30f, 3.4e38f);
  values.gains[3] = Vec3f(0.1f, 1.0f / 3, std::nextafter(1.0f, 2.0f));
  return values;
}

TEST_F(ValuesFile, ComesBackBitForBit) {
  const TexelValues values = smallValues();
  writeValues(path_, values);
  const TexelValues back = readValues(path_);
  EXPECT_EQ(back.scene, values.scene);
  EXPECT_EQ(back.state, values.state);
  EXPECT_EQ(back.params, values.params);
  EXPECT_EQ(back.probes_hash, values.probes_hash);
  EXPECT_EQ(back.texels, 2);
  EXPECT_EQ(back.gains, values.gains);
  // 0.1 in fp32, and nothing for a probe whose gains are all 1.
  EXPECT_NE(readTextFile(path_).find("3dcccccd"), std::string::npos);
  EXPECT_NE(readTextFile(path_).find("\"\"\n"), std::string::npos);
}

TEST_F(ValuesFile, DamageIsNamed) {
  writeValues(path_, smallValues());
  const std::string good = readTextFile(path_);
  struct Case {
    std::string from, to, says;
  };
  for (const Case& c : std::vector<Case>{{"{", "[", "not a JSON object"},
                                         {"probelab values 1", "probelab values 2", "'format'"},
                                         {"\"state\": \"west\"", "\"state\": 3", "'state'"},
                                         {"\"state\": \"west\",", "", "'state' is missing"},
                                         {"\"state\"", "\"stat\"", "unknown key 'stat'"},
                                         {"\"state\"", "\"scene\"", "stands twice"},
                                         {"\"texels\": 2", "\"texels\": 3", "'gains'[0]"},
                                         {"\"texels\": 2", "\"texels\": -2", "'texels'"},
                                         {"\"texels\": 2", "\"texels\": 1e99", "'texels'"},
                                         {"\"probes\": 2", "\"probes\": 3", "list of 3"},
                                         {"3dcccccd", "7f800000", "finite"},
                                         {"3dcccccd", "ffc00000", "finite"},
                                         {"3dcccccd", "bdcccccd", "not negative"},
                                         {"3dcccccd", "3dccccc ", "hexadecimal"},
                                         {"3dcccccd", "3dccccc", "96 digits"},
                                         {"\"\"", "7", "'gains'[1] must be a string"}}) {
    std::string text = good;
    const std::size_t at = text.find(c.from);
    ASSERT_NE(at, std::string::npos) << c.from;
    writeTextFile(path_, text.replace(at, c.from.size(), c.to));
    try {
      readValues(path_);
      ADD_FAILURE() << c.from << " -> " << c.to;
    } catch (const InputError& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.find(path_.string()), 0u) << what;
      EXPECT_NE(what.find(c.says), std::string::npos) << what << " for " << c.to;
    }
  }
}

// A border repeats a texel, so it takes that texel's gain; the root of it with gamma 2.
TEST(TexelsWithGains, BordersAndEncodingFollow) {
  Params params = loadParams("rtxgi");
  for (const char* change : {"irradiance_texels=4", "border=true", "encoding_gamma=2.0"})
    setParam(params, change);
  const TexelValues values = [] {
    TexelValues v = smallValues();
    v.gains.assign(8, Vec3f(1));
    v.gains[4] = Vec3f(4, 1, 0);  // probe 1, texel (0, 0)
    return v;
  }();
  const std::vector<Vec3f> texels =
      texelsWithGains(values, params, std::vector<Vec3f>(32, Vec3f(3)));
  for (std::size_t i = 0; i < 32; ++i) {
    const std::size_t x = i % 4, y = i % 16 / 4;
    // Itself; across the left and the top edge mirrored; the opposite corner.
    const bool gained = i >= 16 && ((x == 1 && y == 1) || (x == 0 && y == 2) ||
                                    (x == 2 && y == 0) || (x == 3 && y == 3));
    EXPECT_EQ(texels[i], gained ? Vec3f(6, 3, 0) : Vec3f(3)) << i;
  }
}

// Each part of what says which texel lies where and what reads it.
TEST(ProbesHash, KnowsEveryPart) {
  const Box3f box{Vec3f(0), Vec3f(1)};
  const ProbeLayout layout = test::boxLayout(box, Vec3i(2), box);
  const ProbeStates states = initialStates(layout);
  const Params params = loadParams("rtxgi");
  const std::string hash = probesHash(layout, states, params);
  EXPECT_EQ(probesHash(test::boxLayout(box, Vec3i(2), box), states, params), hash);
  ProbeStates moved = states, fewer = states;
  moved.positions[3].y += 1e-6f;
  fewer.active[5] = 0;
  EXPECT_NE(probesHash(layout, moved, params), hash);
  EXPECT_NE(probesHash(layout, fewer, params), hash);
  ProbeLayout swapped = layout, wider = layout, influenced = layout;
  std::swap(swapped.probe_of_point[0], swapped.probe_of_point[1]);
  wider.lattice.spacing.x *= 2;
  influenced.influence.entries.push_back({1, {255}});
  for (const ProbeLayout& other : {swapped, wider, influenced})
    EXPECT_NE(probesHash(other, states, params), hash);
  Params finer = params;
  setParam(finer, "irradiance_texels=10");
  EXPECT_NE(probesHash(layout, states, finer), hash);
  setParam(finer, "irradiance_texels=8");
  setParam(finer, "normal_bias=0.3");  // another reading of the same texels
  EXPECT_EQ(probesHash(layout, states, finer), hash);
}

class ValuesOnField : public GpuTest {};

TEST_F(ValuesOnField, GainsMakeTheFittedTexelsAgain) {
  const test::FieldScene scene(test::furnaceScene(0.5f, 1.0f));
  const ProbeLayout layout =
      test::boxLayout({Vec3f(0.3f), Vec3f(1.7f)}, Vec3i(2), scene.scene.bounds);
  for (const char* gamma : {"encoding_gamma=1.0", "encoding_gamma=5.0"}) {
    Params params = test::exactParams("rtxgi");
    setParam(params, gamma);
    setParam(params, "rays=64");
    const auto field = scene.field(gpu(), layout, params);
    field->update(0, {}, {});
    const std::vector<Vec3f> traced = field->irradianceTexels();
    std::vector<Vec3f> fitted = traced;
    const std::size_t tile = fitted.size() / 8;
    for (std::size_t i = 0; i < fitted.size(); ++i)
      fitted[i] = fitted[i] * (0.5f + 0.1f * static_cast<float>(i / tile));
    Receivers receivers;
    receivers.state = "west";
    const TexelValues values = makeValues(*field, receivers, traced, fitted);
    EXPECT_EQ(values.state, "west");
    EXPECT_NO_THROW(checkValues(values, *field, "v.json"));
    applyValues(*field, values);
    const std::vector<Vec3f> applied = field->irradianceTexels();
    for (std::size_t i = 0; i < fitted.size(); ++i)  // gains, roots and products in fp32
      EXPECT_NEAR(static_cast<double>(applied[i].x / fitted[i].x), 1, 4e-7);
  }
}

TEST_F(ValuesOnField, OtherProbesAreRefused) {
  const test::FieldScene scene(test::furnaceScene(0.5f, 1.0f));
  const Box3f box{Vec3f(0.3f), Vec3f(1.7f)};
  Params params = test::exactParams("rtxgi");
  setParam(params, "rays=16");
  const auto field_of = [&](const Box3f& where, const Vec3i& count, const Params& with) {
    return scene.field(gpu(), test::boxLayout(where, count, scene.scene.bounds), with);
  };
  const auto field = field_of(box, Vec3i(2), params);
  const std::vector<Vec3f> texels = field->irradianceTexels();
  const TexelValues values = makeValues(*field, Receivers{}, texels, texels);
  Params finer = params;
  setParam(finer, "irradiance_texels=10");
  const auto refused = [&](const ProbeField& other, const std::string& says) {
    try {
      checkValues(values, other, "v.json");
      ADD_FAILURE() << says;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find("v.json: "), 0u) << error.what();
      EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << error.what();
    }
  };
  refused(*field_of(box, Vec3i(3, 2, 2), params), "8 probes, and the layout has 12");
  refused(*field_of({Vec3f(0.3f), Vec3f(1.6f)}, Vec3i(2), params), "other probes");
  refused(*field_of(box, Vec3i(2), finer), "6 x 6");
  EXPECT_NO_THROW(checkValues(values, *field_of(box, Vec3i(2), params), "v.json"));
}

}  // namespace
}  // namespace probelab
