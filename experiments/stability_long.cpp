// SPDX-License-Identifier: GPL-3.0-or-later
#include "stability_long.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/progress.h"
#include "base/timer.h"
#include "device.h"
#include "evaluation.h"

namespace probelab {
namespace {

constexpr int kBatches = 50, kSamples = 40;  // a batch
constexpr int kFirst = kBatches / 10;        // batches until memory must have settled
constexpr int kLeastBatches = 2 * kFirst;    // that can be judged
constexpr double kGrowth = 2;                // MiB: pools grow by one at a time
constexpr double kTrend = 4;                 // standard errors
constexpr double kVarianceRatio = 2;
// The converged field's directions are others.
constexpr uint64_t kFirstRotation = uint64_t{1} << 32;

double square(double x) { return x * x; }

// Bytes of the process in memory; 0 where the system does not say.
double residentMib() {
  std::ifstream file("/proc/self/statm");
  double pages = 0, resident = 0;
  file >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

double medianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// By how much memory grows steadily from the first batch to the last, MiB: the median slope between
// any two of them ([Theil 1950], [Sen 1968]). A leak shows however it comes, a block that a thread
// gets once, late, does not.
double steadyGrowthMib(std::span<const LongBatch> batches) {
  std::vector<double> slopes;
  for (std::size_t i = 0; i < batches.size(); ++i)
    for (std::size_t j = i + 1; j < batches.size(); ++j)
      slopes.push_back((batches[j].rss_mib - batches[i].rss_mib) / static_cast<double>(j - i));
  return medianOf(std::move(slopes)) * static_cast<double>(batches.size() - 1);
}

std::vector<double> luminances(ProbeField& field, const Receivers& receivers) {
  std::vector<double> values;
  for (const Vec3f& e : queryReceivers(field, receivers)) values.push_back(luminance(Vec3d(e)));
  return values;
}

// Sums over the samples of a batch.
class BatchSums {
 public:
  explicit BatchSums(std::span<const double> area)
      : area_(area), sum_(area.size()), squares_(area.size()), moves_(area.size()) {}

  void add(const std::vector<double>& sample, double update_ms) {
    for (std::size_t i = 0; i < sample.size(); ++i) {
      sum_[i] += sample[i], squares_[i] += square(sample[i]);
      if (count_ > 0 && sample[i] != last_[i]) moves_[i] = 1;
    }
    last_ = sample;
    ++count_;
    times_.push_back(update_ms);
  }

  LongBatch finish(int updates, double slowest_ms) const {
    LongBatch batch{updates, sum_, 0, 0, medianOf(times_), slowest_ms, residentMib()};
    for (std::size_t i = 0; i < sum_.size(); ++i) {
      batch.estimates[i] /= count_;
      const double variance = squares_[i] / count_ - square(batch.estimates[i]);
      batch.variance += area_[i] * std::max(0.0, variance) * count_ / (count_ - 1);
      // Where no light arrives nothing moves.
      if (batch.estimates[i] > 0) batch.frozen += area_[i] * (1 - moves_[i]);
    }
    return batch;
  }

 private:
  std::span<const double> area_;
  std::vector<double> sum_, squares_, moves_, last_, times_;
  double count_ = 0;
};

// Updates before the run that it is judged by: the threads of the device and of the host get the
// last of their memory within some 5,000, and history needs dozens of its lengths to come up from
// black, four times as many where encoded light is blended.
int warmUpdates(double hysteresis) {
  constexpr int kLeast = 5000, kMost = 100000, kLengths = 60;
  return static_cast<int>(std::clamp(kLengths / std::max(1 - hysteresis, 1e-6),
                                     static_cast<double>(kLeast), static_cast<double>(kMost)));
}

// Runs the field; calls for every batch.
void runBatches(ProbeField& field, const Receivers& receivers, int updates, LongRun& run,
                const std::function<void(const LongBatch&)>& on_batch) {
  const auto hysteresis = static_cast<float>(field.params().hysteresis);
  const int interval = updates / (kBatches * kSamples), warm = warmUpdates(hysteresis);
  for (int i = 0; i < warm; ++i) {
    throwIfInterrupted();
    const BlendMode mode{.hysteresis = temporalHysteresis(field.params(), i)};
    field.update(kFirstRotation + static_cast<uint64_t>(i), mode, mode);
    if (i % 10 == 0) luminances(field, receivers);
  }
  const BlendMode mode{.hysteresis = hysteresis};
  int done = 0;
  for (int b = 0; b < kBatches; ++b) {
    BatchSums sums(run.area);
    double slowest_ms = 0;
    for (int s = 0; s < kSamples; ++s) {
      double ms = 0;
      for (int i = 0; i < interval; ++i, ++done) {
        throwIfInterrupted();
        field.update(kFirstRotation + static_cast<uint64_t>(warm + done), mode, mode);
        ms += field.updateWallMs() / interval;
        slowest_ms = std::max(slowest_ms, field.updateWallMs());
      }
      sums.add(luminances(field, receivers), ms);
    }
    run.batches.push_back(sums.finish(done, slowest_ms));
    on_batch(run.batches.back());
  }
}

// Of the batches after the first tenth.
std::span<const LongBatch> settledBatches(const LongRun& run) {
  return std::span(run.batches).subspan(kFirst);
}

double meanVariance(std::span<const LongBatch> batches) {
  double sum = 0;
  for (const LongBatch& b : batches) sum += b.variance / static_cast<double>(batches.size());
  return sum;
}

// Variance over batches of a receiver's mean, mean over receivers by area.
double varianceOfMeans(const LongRun& run) {
  const auto batches = settledBatches(run);
  const auto n = static_cast<double>(batches.size());
  double total = 0;
  for (std::size_t i = 0; i < run.area.size(); ++i) {
    double sum = 0, squares = 0;
    for (const LongBatch& b : batches) sum += b.estimates[i], squares += square(b.estimates[i]);
    total += run.area[i] * std::max(0.0, squares / n - square(sum / n)) * n / (n - 1);
  }
  return total;
}

double meanSquare(const LongRun& run, std::span<const double> values) {
  double sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) sum += run.area[i] * square(values[i]);
  return sum;
}

Json batchJson(const LongRun& run, const LongBatch& batch, const Receivers& receivers) {
  std::vector<Vec3f> grey;
  double mean = 0;
  for (std::size_t i = 0; i < batch.estimates.size(); ++i) {
    grey.emplace_back(static_cast<float>(batch.estimates[i]));
    mean += run.area[i] * batch.estimates[i];
  }
  const ErrorReport errors = scoreEstimates(grey, receivers, ScoredSplit::all);
  return {{"updates", batch.updates},
          {"mean", mean},
          {"distance", rmsDistance(run, batch.estimates, run.converged)},
          {"nrmse", optionalNumber(errors.all.nrmse)},
          {"frozen", batch.frozen},
          {"update_ms", batch.update_ms},
          {"slowest_ms", batch.slowest_ms},
          {"rss_mib", batch.rss_mib}};
}

Json rowsJson(const std::vector<LongRow>& rows) {
  Json cases = Json::array();
  for (const LongRow& row : rows)
    cases.push_back({{"id", row.id},
                     {"group", "long"},
                     {"case", row.title},
                     {"expectation", row.expectation},
                     {"measured", row.measured.text},
                     {"verdict", verdictName(row.measured.verdict)}});
  return cases;
}

Json numbersJson(const LongNumbers& n) {
  return {{"noise", n.noise},         {"expected", n.expected},
          {"farthest", n.farthest},   {"drift", n.drift},
          {"grown_mib", n.grown_mib}, {"frozen", n.frozen},
          {"slowest", n.slowest},     {"variance_ratio", n.variance_ratio}};
}

LongRun emptyRun(const Receivers& receivers) {
  LongRun run;
  double area = 0;
  for (const Receiver& r : receivers.points) area += r.area;
  for (const Receiver& r : receivers.points) run.area.push_back(r.area / area);
  return run;
}

Json describe(const LongRun& run, const Receivers& receivers, const Params& params,
              double seconds) {
  Json batches = Json::array();
  for (const LongBatch& batch : run.batches) batches.push_back(batchJson(run, batch, receivers));
  // A run that was interrupted early is not judged.
  const bool judged = run.batches.size() >= kLeastBatches;
  const LongNumbers numbers = judged ? longNumbers(run) : LongNumbers();
  const int done = run.batches.back().updates;
  return {{"receivers", receivers.points.size()},
          {"params", params.name},
          {"rays", params.rays},
          {"hysteresis", params.hysteresis},
          {"updates", done},
          {"updates_per_s", done / seconds},
          {"nrmse", batches.back()["nrmse"]},
          {"long_run", judged ? numbersJson(numbers) : Json(nullptr)},
          {"batches", batches},
          {"trusted", fmt::format("{} updates with hysteresis {}, {:.0f} a second.", done,
                                  params.hysteresis, done / seconds)},
          {"cases", judged ? rowsJson(judgeLongRun(numbers)) : Json::array()}};
}

}  // namespace

double rmsDistance(const LongRun& run, std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += run.area[i] * square(a[i] - b[i]);
  return std::sqrt(sum / meanSquare(run, b));
}

double trend(std::span<const double> values) {
  const auto n = static_cast<double>(values.size());
  const double mean_x = (n - 1) / 2, mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double xx = 0, xy = 0, yy = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = static_cast<double>(i) - mean_x, y = values[i] - mean;
    xx += x * x, xy += x * y, yy += y * y;
  }
  const double left = std::max(0.0, yy - xy * xy / xx);  // of the squares, beside the line
  if (xy == 0) return 0;
  return xy / xx / std::sqrt(left / (n - 2) / xx);
}

LongNumbers longNumbers(const LongRun& run) {
  const auto batches = settledBatches(run);
  const double scale = std::sqrt(meanSquare(run, run.converged));
  LongNumbers n;
  n.noise = std::sqrt(meanVariance(batches)) / scale;
  // The converged field is an average of as many updates as a batch's.
  n.expected = std::sqrt(2 * varianceOfMeans(run)) / scale;
  std::vector<double> means, times;
  for (const LongBatch& b : batches) {
    n.farthest = std::max(n.farthest, rmsDistance(run, b.estimates, run.converged));
    n.frozen = std::max(n.frozen, b.frozen);
    double mean = 0;
    for (std::size_t i = 0; i < run.area.size(); ++i) mean += run.area[i] * b.estimates[i];
    means.push_back(mean), times.push_back(b.update_ms);
  }
  n.drift = trend(means);
  n.grown_mib = steadyGrowthMib(batches);
  const auto [fastest, slowest] = std::minmax_element(times.begin(), times.end());
  n.slowest = *slowest / *fastest;
  const std::size_t quarter = batches.size() / 4;
  n.variance_ratio = meanVariance(batches.last(quarter)) / meanVariance(batches.first(quarter));
  return n;
}

std::vector<LongRow> judgeLongRun(const LongNumbers& n) {
  const auto judged = [](bool holds, const std::string& text) {
    return Measurement{holds ? Verdict::holds : Verdict::fails, text, std::nullopt};
  };
  return {{"long.memory", "resident memory",
           "grows steadily by at most 2 MiB after the first tenth of the run",
           judged(n.grown_mib <= kGrowth, fmt::format("{:+.2f} MiB", n.grown_mib))},
          {"long.drift", "mean light over the run", "no trend beyond 4 standard errors",
           judged(std::abs(n.drift) <= kTrend, fmt::format("{:+.2f} standard errors", n.drift))},
          {"long.converged", "distance from the converged field",
           "every batch's mean nearer than the noise that history leaves at any one time",
           judged(n.farthest <= n.noise,
                  fmt::format("{:.2g} at most, noise {:.2g}; averages alone differ by {:.2g}",
                              n.farthest, n.noise, n.expected))},
          {"long.stall", "the field still moves",
           "no receiver frozen for a batch; noise of the last quarter within 2 x the first's",
           judged(n.frozen == 0 && n.variance_ratio <= kVarianceRatio &&
                      n.variance_ratio >= 1 / kVarianceRatio,
                  fmt::format("{:.2g} frozen, noise x {:.3f}, slowest batch's updates x {:.2f}",
                              n.frozen, n.variance_ratio, n.slowest))}};
}

Json runLongRun(const SceneStabilityOptions& options, int updates, const Invocation& invocation) {
  static_assert(kLongRunStep == kBatches * kSamples);
  if (updates % kLongRunStep != 0)
    throwInput("--long-run {}: batches and their samples are equally long in multiples of {} only: "
               "ask for {}",
               updates, kLongRunStep, (updates / kLongRunStep + 1) * kLongRunStep);
  SceneSetup setup(options.scene, invocation);
  const Params params = resolveParams(options.field);
  const Receivers receivers =
      obtainTruth(options.truth, setup.scene, setup.embree, setup.reachability, invocation)
          .receivers;
  FieldOptions of_field = options.field;
  of_field.tracer = options.tracer == "rayquery" ? "rayquery" : "embree";
  FieldPlan plan{.options = of_field, .seed = invocation.common.seed};
  LongRun run = emptyRun(receivers);
  {
    const auto field = makeField(setup, params, plan);
    convergeField(*field, {.average = updates / kBatches});
    run.converged = luminances(*field, receivers);
  }
  if (!(meanSquare(run, run.converged) > 0))
    throwInput("{}: no light arrives at the receivers in state '{}'; choose another with --state",
               setup.scene.path, setup.scene.state);
  plan.accumulate = false;
  const auto field = makeField(setup, params, plan);
  Progress progress("long run", kBatches, invocation.common.quiet);
  const Timer timer;
  const bool interrupted = endsInterrupted([&] {
    runBatches(*field, receivers, updates, run,
               [&](const LongBatch&) { progress.update(static_cast<double>(run.batches.size())); });
  });
  if (run.batches.empty()) throw Interrupted();
  progress.finish();
  requireNoValidationMessages(setup.gpu);
  Json result = describe(run, receivers, params, timer.seconds());
  result["interrupted"] = interrupted;
  result["scene"] = setup.scene.name;
  result["state"] = setup.scene.state;
  result["probes"] = field->probeCount();
  result["device"] = setup.gpu.info().name;
  result["provenance"] = toJson(setup.provenance);
  return result;
}

}  // namespace probelab
