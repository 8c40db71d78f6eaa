// SPDX-License-Identifier: GPL-3.0-or-later
// Names, hashes, percentiles, parallel loops and whole files.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <mutex>

#include "base/error.h"
#include "base/files.h"
#include "base/hash.h"
#include "base/interrupt.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "base/suggest.h"
#include "base/timer.h"

namespace probelab {
namespace {
namespace fs = std::filesystem;

TEST(Suggest, FindsTheNearestName) {
  const std::vector<std::string> names = {"normal_bias", "view_bias", "hysteresis"};
  EXPECT_EQ(nearestName("normal_bais", names), "normal_bias");
  EXPECT_EQ(nearestName("hysteresi", names), "hysteresis");
  EXPECT_EQ(nearestName("colour", names), "");
  EXPECT_EQ(suggestion("viewbias", names), ", did you mean 'view_bias'?");
  EXPECT_EQ(suggestion("colour", names), "; known are: normal_bias, view_bias, hysteresis");
  EXPECT_EQ(suggestion("colour", {}), ", there are none");
  EXPECT_EQ(nearestName("view_bias_of_the_probes", names), "");
}

// A name as long as a damaged file is not compared: a million letters took minutes.
TEST(Suggest, LooksAtNamesThatSomebodyMayHaveTyped) {
  const std::vector<std::string> names = {std::string(64, 'a'), std::string(999'999, 'a')};
  EXPECT_EQ(nearestName(std::string(63, 'a'), names), names[0]);
  EXPECT_EQ(nearestName(std::string(65, 'a'), names), "");
  const Timer timer;
  EXPECT_EQ(nearestName(std::string(1'000'000, 'a'), names), "");
  EXPECT_LT(timer.seconds(), 1);
}

TEST(Hash, IsThatOfXxh3) {
  // XXH3_128bits of no bytes, from the algorithm's own test values.
  EXPECT_EQ(contentHash(""), "99aa06d3014798d86001c324468d497f");
  EXPECT_EQ(contentHash("a").size(), 32u);
  EXPECT_NE(contentHash("a"), contentHash("b"));
  const std::string text = "abc";
  EXPECT_EQ(contentHash(std::as_bytes(std::span(text.data(), 3))), contentHash(text));
}

TEST(Percentile, InterpolatesBetweenOrderStatistics) {
  EXPECT_EQ(percentile({3, 1, 2}, 0.5), 2);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.5), 2.5);
  EXPECT_EQ(percentile({10, 20}, 0.25), 12.5);
  EXPECT_EQ(percentile({1, 2, 3}, 0), 1);
  EXPECT_EQ(percentile({1, 2, 3}, 1), 3);
  EXPECT_EQ(percentile({7}, 0.99), 7);
  EXPECT_EQ(percentile({}, 0.5), 0);
  std::vector<double> times;
  for (int i = 0; i <= 100; ++i) times.push_back(i);
  const TimeSummary s = summarizeTimes(times);
  EXPECT_DOUBLE_EQ(s.p5, 5);
  EXPECT_DOUBLE_EQ(s.median, 50);
  EXPECT_DOUBLE_EQ(s.p95, 95);
  EXPECT_EQ(s.samples, 101);
}

TEST(Duration, ReadsAsPeopleSayIt) {
  EXPECT_EQ(formatDuration(12.4), "12 s");
  EXPECT_EQ(formatDuration(200), "3 min 20 s");
  EXPECT_EQ(formatDuration(3840), "1 h 04 min");
  EXPECT_EQ(formatDuration(-1), "0 s");
}

TEST(ParallelFor, VisitsEveryIndexOnceInAlignedRanges) {
  for (const size_t count : {size_t{0}, size_t{1}, size_t{7}, size_t{64}, size_t{1001}})
    for (const size_t grain : {size_t{0}, size_t{1}, size_t{8}, size_t{5000}}) {
      std::vector<std::atomic<int>> visits(count);
      const size_t largest = std::max<size_t>(grain, 1);
      std::atomic<bool> aligned = true;
      parallelFor(count, grain, [&](size_t begin, size_t end) {
        if (begin >= end || end - begin > largest || begin % largest != 0) aligned = false;
        for (size_t i = begin; i < end; ++i) ++visits[i];
      });
      EXPECT_TRUE(aligned) << count << " " << grain;
      for (const auto& v : visits) EXPECT_EQ(v, 1) << count << " " << grain;
    }
}

TEST(ParallelFor, RethrowsWhatTheBodyThrows) {
  const auto run = [] {
    parallelFor(100, 1, [](size_t begin, size_t) {
      if (begin == 50) throwInput("at {}", begin);
    });
  };
  EXPECT_THROW(run(), InputError);
}

TEST(ThreadLimit, HoldsWhileItLives) {
  const int before = threadCount();
  {
    const ThreadLimit limit(1);
    EXPECT_EQ(threadCount(), 1);
  }
  EXPECT_EQ(threadCount(), before);
}

TEST(ErrorsDeathTest, CarryTheExitCodeOfTheirKind) {
  EXPECT_EQ(InputError("x").exitCode(), 2);
  EXPECT_EQ(DeviceError("x").exitCode(), 1);
  EXPECT_EQ(NumericalError("x").exitCode(), 1);
  EXPECT_EQ(Interrupted().exitCode(), 130);
  EXPECT_DEATH(PROBELAB_CHECK_EQ(1 + 1, 3), "1 \\+ 1 == 3: 2 against 3");
}

TEST(InterruptDeathTest, IsNotRequestedUntilASignalArrives) {
  EXPECT_FALSE(interruptRequested());
  EXPECT_NO_THROW(throwIfInterrupted());
  EXPECT_EXIT(
      {
        installInterruptHandler();
        raise(SIGINT);
        try {
          throwIfInterrupted();
        } catch (const Interrupted& e) {
          std::_Exit(e.exitCode());
        }
      },
      ::testing::ExitedWithCode(130), "");
}

class Files : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("files_" + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  long entries() const {
    return std::distance(fs::directory_iterator(folder_), fs::directory_iterator());
  }
  fs::path folder_;
};

TEST_F(Files, ComeBackAsWritten) {
  const std::string text("a\0b\r\n\xff", 6);
  writeTextFile(folder_ / "x", text);
  EXPECT_EQ(readTextFile(folder_ / "x"), text);
  EXPECT_EQ(readFile(folder_ / "x").size(), 6u);
  writeTextFile(folder_ / "x", "");
  EXPECT_EQ(readTextFile(folder_ / "x"), "");
  EXPECT_EQ(entries(), 1);
}

TEST_F(Files, KeepTheOldOneWhenWritingFails) {
  writeTextFile(folder_ / "x", "old");
  const auto fail = [](const fs::path& temporary) {
    std::ofstream(temporary) << "half";
    throw Error("no space");
  };
  EXPECT_THROW(writeFileAtomically(folder_ / "x", fail), Error);
  EXPECT_EQ(readTextFile(folder_ / "x"), "old");
  EXPECT_EQ(entries(), 1);
}

TEST_F(Files, AreReplacedOnlyOnceComplete) {
  writeTextFile(folder_ / "x", "old");
  writeFileAtomically(folder_ / "x", [&](const fs::path& temporary) {
    EXPECT_EQ(temporary.parent_path(), folder_);  // a rename works within one file system only
    std::ofstream(temporary) << "new";
    EXPECT_EQ(readTextFile(folder_ / "x"), "old");
  });
  EXPECT_EQ(readTextFile(folder_ / "x"), "new");
}

TEST_F(Files, NameWhatIsWrongWithAPath) {
  EXPECT_THROW(readFile(folder_ / "none"), InputError);
  EXPECT_THROW(readFile(folder_), InputError);
  EXPECT_THROW(checkWritable(folder_), InputError);
  EXPECT_THROW(checkWritable(folder_ / "none" / "x"), InputError);
  EXPECT_NO_THROW(checkWritable(folder_ / "x"));
  EXPECT_EQ(entries(), 0);
  EXPECT_THROW(writeTextFile(folder_ / "none" / "x", "text"), Error);
}

// A rename would put a file in the place of /dev/full for all programs.
TEST_F(Files, NeverReplaceADeviceOrAPipe) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(checkWritable(folder_ / "pipe"), InputError);
  EXPECT_THROW(writeTextFile(folder_ / "pipe", "text"), InputError);
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
  EXPECT_EQ(entries(), 1);
}

}  // namespace
}  // namespace probelab
