// SPDX-License-Identifier: GPL-3.0-or-later
// The hard-case suite, run once: every row by its id, no row that fails, at least 60 that hold, and
// each limit where limits.json says that it lies.
#include "stability/suite.h"

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "base/error.h"
#include "gpu_fixture.h"

namespace probelab {
namespace {

class Stability : public GpuTest {};

// Numbers of the two lists of hard cases that the rows stand for.
void expectEveryCaseOfTheLists(const std::vector<PlannedRow>& planned) {
  std::set<std::string> covered;
  for (const PlannedRow& row : planned) {
    std::istringstream numbers(row.of.list);
    for (std::string number; numbers >> number;) covered.insert(number);
  }
  for (int i = 1; i <= 49; ++i) EXPECT_TRUE(covered.contains("G" + std::to_string(i))) << i;
  for (int i = 1; i <= 23; ++i) EXPECT_TRUE(covered.contains("P" + std::to_string(i))) << i;
}

TEST_F(Stability, EveryRowHoldsOrEndsWhereItIsKnownTo) {
  std::ifstream file(PROBELAB_SOURCE_DIR "/tests/stability/limits.json");
  const nlohmann::json limits = nlohmann::json::parse(file);
  const std::vector<PlannedRow> planned = planRows("");
  expectEveryCaseOfTheLists(planned);
  std::map<std::string, StabilityRow> rows;
  double seconds = 0;
  for (const StabilityRow& row : runRows(gpu(), planned)) {
    EXPECT_TRUE(rows.emplace(row.id, row).second) << row.id << " comes twice";
    seconds += row.seconds;
  }
  int holds = 0;
  for (const PlannedRow& plan : planned) {
    if (plan.variant.tracer == "rayquery" && !gpu().info().ray_query) continue;
    SCOPED_TRACE(plan.id);
    ASSERT_TRUE(rows.contains(plan.id));
    const Measurement& m = rows.at(plan.id).measured;
    // Limits of a device's own intersection tests are recorded for Mesa's software device.
    const bool is_known = plan.variant.tracer != "rayquery" || gpu().info().is_cpu;
    if (m.verdict == Verdict::holds) ++holds;
    EXPECT_NE(m.verdict, Verdict::fails) << m.text;
    if (!is_known) continue;
    EXPECT_EQ(m.verdict == Verdict::limit, limits.contains(plan.id)) << m.text;
    if (m.verdict != Verdict::limit || !limits.contains(plan.id)) continue;
    const double recorded = limits.at(plan.id).get<double>();
    ASSERT_TRUE(m.breaking_point.has_value());
    EXPECT_NEAR(*m.breaking_point, recorded, 0.2 * recorded) << m.text;
  }
  EXPECT_GE(holds, 60);
  RecordProperty("seconds", std::to_string(seconds));
}

TEST(StabilityNames, FindRowsCasesGroupsAndPatterns) {
  EXPECT_EQ(planRows("query.cell_faces/plain").size(), 1u);
  EXPECT_GT(planRows("query.cell_faces").size(), 1u);
  EXPECT_GT(planRows("geometry").size(), planRows("geometry.shift").size());
  for (const PlannedRow& row : planRows("*rgb10a2")) EXPECT_TRUE(row.id.ends_with("rgb10a2"));
  EXPECT_EQ(planRows("qu*cell_f*a*").size(), planRows("query.cell_faces").size());
  EXPECT_EQ(planRows("*").size(), planRows("").size());
  EXPECT_EQ(planRows(std::string(60, '*')).size(), planRows("").size());  // at once
  EXPECT_THROW(planRows("*query.cell_faces"), InputError);
  try {
    planRows("query.cel_faces");
    ADD_FAILURE() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'query.cell_faces'"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace probelab
