// SPDX-License-Identifier: GPL-3.0-or-later
#include "budget_score.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "table.h"

namespace probelab {
namespace {

constexpr int kBarWidth = 24;  // of the largest share

double luminanceOf(const Vec3f& v) { return luminance(Vec3d(v)); }

// sum a x y over sum a A B; x and y give a number a receiver.
template <class X, class Y>
std::optional<double> relativeProduct(const Receivers& scored, const X& x, const Y& y) {
  double sum = 0, power = 0;
  for (std::size_t i = 0; i < scored.points.size(); ++i) {
    const Receiver& r = scored.points[i];
    sum += r.area * x(i) * y(i);
    power += r.area * luminanceOf(r.a) * luminanceOf(r.b);
  }
  return power > 0 ? std::optional(sum / power) : std::nullopt;
}

std::string shareBar(double share, double largest) {
  const auto length = static_cast<std::size_t>(std::lround(kBarWidth * std::abs(share) / largest));
  std::string bar(length, share < 0 ? '-' : '#');
  bar.resize(kBarWidth, ' ');
  return bar;
}

}  // namespace

std::optional<double> budgetMeanSquare(const RungEstimate& estimate, const Receivers& scored) {
  const auto off = [&](const std::vector<Vec3f>& e, Vec3f Receiver::*truth) {
    return [&, truth](std::size_t i) {
      return luminanceOf(e[i]) - luminanceOf(scored.points[i].*truth);
    };
  };
  const auto one = relativeProduct(scored, off(estimate.first, &Receiver::a),
                                   off(estimate.second, &Receiver::b));
  const auto other = relativeProduct(scored, off(estimate.second, &Receiver::a),
                                     off(estimate.first, &Receiver::b));
  return one ? std::optional((*one + *other) / 2) : std::nullopt;
}

BudgetRung scoreRung(const std::string& name, const std::string& about,
                     const RungEstimate& estimate, const Receivers& scored) {
  BudgetRung rung;
  rung.name = name, rung.about = about;
  rung.mean_square = budgetMeanSquare(estimate, scored);
  std::vector<Vec3f> mean(estimate.first.size());
  for (std::size_t i = 0; i < mean.size(); ++i)
    mean[i] = (estimate.first[i] + estimate.second[i]) * 0.5f;
  rung.report = scoreEstimates(mean, scored, ScoredSplit::all);
  if (rung.mean_square) rung.nrmse = std::sqrt(std::max(0.0, *rung.mean_square));
  if (estimate.first == estimate.second) rung.nrmse = rung.report.all.nrmse;
  const auto difference = [&](std::size_t i) {
    return luminanceOf(estimate.first[i]) - luminanceOf(estimate.second[i]);
  };
  if (const auto squared = relativeProduct(scored, difference, difference))
    rung.noise = std::sqrt(*squared / 2);
  return rung;
}

Json rungsJson(const std::vector<BudgetRung>& rungs) {
  Json json = Json::array();
  const double last = rungs.back().mean_square.value_or(0);
  double before = 0;
  for (const BudgetRung& rung : rungs) {
    const ErrorMetrics& all = rung.report.all;
    Json row = {{"name", rung.name}, {"about", rung.about}};
    std::optional<double> share;
    if (rung.mean_square && last > 0) share = (*rung.mean_square - before) / last;
    before = rung.mean_square.value_or(0);
    row["nrmse"] = optionalNumber(rung.nrmse);
    row["bias"] = optionalNumber(all.bias);
    row["light_leak"] = optionalNumber(all.light_leak);
    row["shadow_leak"] = optionalNumber(all.shadow_leak);
    row["smape"] = optionalNumber(all.smape);
    row["share"] = optionalNumber(share);
    row["mean_square"] = optionalNumber(rung.mean_square);
    row["noise"] = optionalNumber(rung.noise);
    json.push_back(row);
  }
  return json;
}

std::string formatRungs(const Json& rungs) {
  const auto cell = [](const Json& value) {
    return value.is_null() ? std::string("-") : formatNumber(value.get<double>());
  };
  double largest = 0;
  for (const Json& rung : rungs)
    if (!rung["share"].is_null())
      largest = std::max(largest, std::abs(rung["share"].get<double>()));
  TextTable table({"rung", "nrmse", "bias", "light_leak", "shadow_leak", "smape", "share", ""});
  std::vector<std::pair<std::string, std::string>> about;
  for (const Json& rung : rungs) {
    const Json& share = rung["share"];
    table.addRow({rung["name"].get<std::string>(), cell(rung["nrmse"]), cell(rung["bias"]),
                  cell(rung["light_leak"]), cell(rung["shadow_leak"]), cell(rung["smape"]),
                  share.is_null() ? "-" : fmt::format("{:.1f} %", 100 * share.get<double>()),
                  share.is_null() ? "" : shareBar(share.get<double>(), largest)});
    about.emplace_back(rung["name"].get<std::string>(), rung["about"].get<std::string>());
  }
  return fmt::format(
      "{}\n{}\nshare: rise of the squared error over the rung above, of the field's; negative (-) "
      "where a new error makes up for an older one\n",
      table.text(), formatFields(about));
}

}  // namespace probelab
