// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/receivers.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <set>

#include "base/error.h"
#include "base/files.h"
#include "base/parallel.h"
#include "scene_builders.h"
#include "trace/surface.h"

namespace probelab::test {
namespace {

// A room of 4 x 3 x 2 m with 10 cm walls, seen by one camera, and a closed closet beside it.
Scene room(const Vec3d& origin = Vec3d()) {
  SceneBuilder builder;
  const uint32_t m = builder.material(Vec3f(0.5f), Vec3f(1));
  builder.shell(Vec3f(-2, 0, -1), Vec3f(2, 3, 1), 0.1f, m, m);
  builder.shell(Vec3f(5, 0, -1), Vec3f(6, 3, 1), 0.1f, m, m);
  builder.camera(Vec3f(-1, 1, 0), Vec3f(1, 1, 0));
  builder.scene().origin = origin;
  return builder.finish();
}

struct Made {
  Scene scene;
  EmbreeScene embree;
  Reachability reachability;
  explicit Made(Scene s)
      : scene(std::move(s)), embree(scene), reachability(findReachable(scene, embree)) {}
  Receivers receivers(uint32_t count, uint64_t seed) const {
    return generateReceivers(scene, embree, reachability, count, seed);
  }
};

class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name)
      : path_(std::filesystem::path(testing::TempDir()) / name) {}
  ~TemporaryFile() { std::filesystem::remove(path_); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

TEST(Receivers, SevenTenthsOnSurfacesAndWeightsSumToTheirShares) {
  const Made made(room());
  const Receivers r = made.receivers(1000, 1);
  std::map<ReceiverKind, double> weight;
  std::map<ReceiverKind, int> count;
  for (const Receiver& p : r.points) weight[p.kind] += p.area, ++count[p.kind];
  EXPECT_EQ(count[ReceiverKind::surface], 700);
  EXPECT_EQ(count[ReceiverKind::volume], 300);
  EXPECT_NEAR(weight[ReceiverKind::surface], 0.7, 1e-12);
  EXPECT_NEAR(weight[ReceiverKind::volume], 0.3, 1e-12);
}

TEST(Receivers, LieInTheReachableRoomOnlyAndFaceIt) {
  const Made made(room());
  const int region = regionOf(made.reachability, made.embree, Vec3f(0, 1, 0));
  for (const Receiver& p : made.receivers(2000, 2).points) {
    EXPECT_EQ(p.region, region);
    EXPECT_TRUE(p.position.x >= -2.0001f && p.position.x <= 2.0001f);
    EXPECT_TRUE(p.position.y >= -1e-4f && p.position.y <= 3.0001f);
    EXPECT_NEAR(length(p.normal), 1, 1e-5);
    EXPECT_NEAR(length(p.view), 1, 1e-5);
    if (p.kind == ReceiverKind::surface) {
      EXPECT_GT(dot(Vec3f(0, 1.5f, 0) - p.position, p.normal), 0);
      EXPECT_LT(dot(p.view, p.normal), 0);  // the camera sees every wall of the room
      const Vec3f from_camera = normalize(p.position - Vec3f(-1, 1, 0));
      EXPECT_NEAR(dot(from_camera, p.view), 1, 1e-5);
    }
  }
}

// Areas of the room's faces: 2 x (12 + 8 + 6) m^2; floor and ceiling have 16 of 52. Binomial
// standard deviation of 7000 draws: 0.55 %; five of it. Volume: half lie below y = 1.5, 0.91 %.
TEST(Receivers, AreUniformByAreaAndByVolume) {
  const Made made(room());
  int horizontal = 0, surfaces = 0, low = 0, volumes = 0, near_wall = 0;
  for (const Receiver& p : made.receivers(10000, 3).points) {
    if (p.kind == ReceiverKind::surface) {
      ++surfaces, horizontal += std::abs(p.normal.y) > 0.5f;
    } else {
      ++volumes, low += p.position.y < 1.5f, near_wall += p.position.x < -1.98f;
    }
  }
  EXPECT_NEAR(static_cast<double>(horizontal) / surfaces, 16.0 / 52, 5 * 0.0055);
  EXPECT_NEAR(static_cast<double>(low) / volumes, 0.5, 5 * 0.0091);
  // Cells at the walls are occupied (6 cm), yet the space in them counts: 0.5 % of the volume.
  EXPECT_NEAR(static_cast<double>(near_wall) / volumes, 0.005, 5 * 0.0013);
}

TEST(Receivers, DependOnTheSeedAndNotOnTheThreads) {
  const Made made(room());
  const auto positions = [&](uint64_t seed, int threads) {
    const ThreadLimit limit(threads);
    std::vector<float> all;
    for (const Receiver& p : made.receivers(200, seed).points)
      all.insert(all.end(), {p.position.x, p.position.y, p.position.z, p.normal.x});
    return all;
  };
  EXPECT_EQ(positions(1, 1), positions(1, 2));
  EXPECT_NE(positions(1, 1), positions(2, 1));
}

TEST(Receivers, SplitIsByBlocksAndAboutHalf) {
  const Made made(room());
  const Receivers r = made.receivers(4000, 4);
  std::map<std::array<int, 3>, std::set<Split>> blocks;
  const float edge = made.scene.bounds.diagonal() / 16;
  int train = 0;
  for (const Receiver& p : r.points) {
    const Vec3f q = (p.position - made.scene.bounds.min) / edge;
    blocks[{static_cast<int>(q.x), static_cast<int>(q.y), static_cast<int>(q.z)}].insert(p.split);
    train += p.split == Split::train;
  }
  int mixed = 0;
  for (const auto& [block, splits] : blocks) mixed += splits.size() > 1;
  EXPECT_LE(mixed, 1);  // a point on a block's face may round differently here
  EXPECT_GT(blocks.size(), 100u);
  EXPECT_NEAR(train / 4000.0, 0.5, 0.2);  // ~200 blocks, binomial 3.5 %, unequal shares
}

TEST(Receivers, FoldsAreOfTheSameBlocksAndAlike) {
  const Made made(room());
  const Receivers r = made.receivers(4000, 4);
  constexpr int kFolds = 4;
  std::map<std::array<int, 3>, std::set<int>> blocks;
  const float edge = made.scene.bounds.diagonal() / 16;
  std::array<double, kFolds> train{}, heldout{};
  for (const Receiver& p : r.points) {
    const int fold = receiverFold(made.scene.bounds, p.position, kFolds);
    ASSERT_GE(fold, 0);
    ASSERT_LT(fold, kFolds);
    (p.split == Split::train ? train : heldout)[static_cast<std::size_t>(fold)] += 1.0 / 4000;
    const Vec3f q = (p.position - made.scene.bounds.min) / edge;
    blocks[{static_cast<int>(q.x), static_cast<int>(q.y), static_cast<int>(q.z)}].insert(fold);
  }
  int mixed = 0;
  for (const auto& [block, folds] : blocks) mixed += folds.size() > 1;
  EXPECT_LE(mixed, 1);
  // Folds do not go with the split: each has about an eighth of all on either side (~25 blocks,
  // unequal shares).
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    EXPECT_NEAR(train[fold], 0.125, 0.08);
    EXPECT_NEAR(heldout[fold], 0.125, 0.08);
  }
}

TEST(Receivers, SkyOnlyScenesHaveVolumeReceivers) {
  SceneBuilder builder;
  builder.scene().bounds = {Vec3f(-1), Vec3f(1)};
  builder.scene().sky.radiance = Vec3f(1);
  const Made made(builder.finish());
  const Receivers r = made.receivers(100, 5);
  double sum = 0;
  for (const Receiver& p : r.points) {
    EXPECT_EQ(p.kind, ReceiverKind::volume);
    sum += p.area;
  }
  EXPECT_NEAR(sum, 1, 1e-12);
}

TEST(Receivers, ZeroIsAnError) {
  const Made made(room());
  EXPECT_THROW(made.receivers(0, 1), InputError);
}

TEST(ReceiversFile, RoundTripsInWorldCoordinates) {
  const Made made(room(Vec3d(1000, -2000, 3000)));
  Receivers r = made.receivers(50, 6);
  SampleBudget budget;
  budget.spp = 32;
  traceReceivers(r, made.scene, made.embree, budget, 6);
  const TemporaryFile file("receivers_round_trip.json");
  writeReceivers(file.path(), r, made.scene);
  const Receivers read = readReceivers(file.path(), made.scene);
  ASSERT_EQ(read.points.size(), r.points.size());
  for (std::size_t i = 0; i < r.points.size(); ++i) {
    EXPECT_EQ(read.points[i].position, r.points[i].position);
    EXPECT_EQ(read.points[i].normal, r.points[i].normal);
    EXPECT_EQ(read.points[i].view, r.points[i].view);
    EXPECT_EQ(read.points[i].area, r.points[i].area);
    EXPECT_EQ(read.points[i].kind, r.points[i].kind);
    EXPECT_EQ(read.points[i].split, r.points[i].split);
    EXPECT_EQ(read.points[i].a, r.points[i].a);
    EXPECT_EQ(read.points[i].b, r.points[i].b);
  }
  EXPECT_EQ(read.samples, 32u);
  EXPECT_EQ(read.seed, 6u);
  EXPECT_EQ(read.rel_error, r.rel_error);
  EXPECT_NE(readTextFile(file.path()).find("\"position\":[99"), std::string::npos);
}

TEST(ReceiversFile, OfAnotherSceneOrStateIsRefused) {
  const Made made(room());
  const TemporaryFile file("receivers_other.json");
  writeReceivers(file.path(), made.receivers(10, 1), made.scene);
  Scene other = made.scene;
  other.content_hash = "another";
  EXPECT_THROW(readReceivers(file.path(), other), InputError);
  Scene evening = made.scene;
  evening.state = "evening";
  EXPECT_THROW(readReceivers(file.path(), evening), InputError);
}

TEST(ReceiversFile, DamageIsNamed) {
  const Made made(room());
  const TemporaryFile file("receivers_damaged.json");
  writeReceivers(file.path(), made.receivers(10, 1), made.scene);
  const std::string good = readTextFile(file.path());
  const auto message = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    writeTextFile(file.path(), text);
    try {
      readReceivers(file.path(), made.scene);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message("\"kind\":\"surface\"", "\"kind\":\"wall\"").find("receivers[0]"),
            std::string::npos);
  EXPECT_NE(message("\"area\"", "\"era\"").find("'area' is missing"), std::string::npos);
  EXPECT_NE(message("\"normal\":[", "\"normal\":[3,").find("three finite"), std::string::npos);
  EXPECT_NE(message("\"receivers\"", "").find("not a JSON"), std::string::npos);
}

class PointsFile : public testing::Test {
 protected:
  Receivers read(const std::string& text) {
    writeTextFile(file_.path(), text);
    return readReceiverPoints(file_.path(), made_.scene, made_.embree, made_.reachability);
  }
  std::string errorOf(const std::string& text) {
    try {
      read(text);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  Made made_{room(Vec3d(10, 0, 0))};
  TemporaryFile file_{"points.csv"};
};

TEST_F(PointsFile, ReadsPointsWithAndWithoutHeader) {
  const Receivers r = read("x,y,z,nx,ny,nz\r\n10, 1, 0, 0, 2, 0\n\n# note\n15.5,1,0,0,0,1\n");
  ASSERT_EQ(r.points.size(), 2u);
  EXPECT_EQ(r.points[0].position, Vec3f(0, 1, 0));
  EXPECT_EQ(r.points[0].normal, Vec3f(0, 1, 0));
  EXPECT_EQ(r.points[0].view, Vec3f(0, -1, 0));
  EXPECT_EQ(r.points[0].area, 0.5);
  EXPECT_EQ(r.points[0].split, Split::heldout);
  EXPECT_NE(r.points[0].region, r.points[1].region);
  EXPECT_EQ(read("10,1,0,0,1,0\n").points.size(), 1u);
  // A spreadsheet's byte order mark.
  EXPECT_EQ(read("\xEF\xBB\xBFx,y,z,nx,ny,nz\n10,1,0,0,1,0\n").points.size(), 1u);
}

TEST_F(PointsFile, ErrorsNameTheLine) {
  EXPECT_NE(errorOf("x,y,z,nx,ny,nz\n1,2,3\n").find("line 2"), std::string::npos);
  EXPECT_NE(errorOf("1,2,3,0,0,0\n").find("no direction"), std::string::npos);
  EXPECT_NE(errorOf("1,2,3,0,1,0\n1,nan,3,0,1,0\n").find("line 2"), std::string::npos);
  EXPECT_NE(errorOf("1,2,3,0,1,0x\n").find("'0x'"), std::string::npos);
  EXPECT_NE(errorOf("x,y,z,nx,ny,nz\n").find("no points"), std::string::npos);
}

}  // namespace
}  // namespace probelab::test
