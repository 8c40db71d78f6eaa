// SPDX-License-Identifier: GPL-3.0-or-later
// The hard-case suite, run once: every row by its id, no row that fails, at least 60 that hold, and
// each limit where the program's own record says that it lies.
#include "stability/suite.h"

#include <map>
#include <set>
#include <sstream>

#include "base/error.h"
#include "gpu_fixture.h"
#include "stability/limits.h"

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
  const RecordedLimits limits = recordedLimits(gpu().info().name);
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
    if (m.verdict == Verdict::holds) ++holds;
    EXPECT_NE(m.verdict, Verdict::fails) << m.text;
    if (limits.empty()) continue;
    EXPECT_EQ(m.verdict == Verdict::limit, limits.contains(plan.id)) << m.text;
  }
  EXPECT_GE(holds, 60);
  RecordProperty("seconds", std::to_string(seconds));
}

TEST(StabilityLimits, AreHeldToTheRecordOfTheirDevice) {
  const RecordedLimits none, known{{"a.b", 10}};
  const auto verdict = [](Verdict was, std::optional<double> at, const RecordedLimits& limits,
                          const std::string& id = "a.b") {
    return againstRecord({was, "", at}, id, limits).verdict;
  };
  EXPECT_EQ(verdict(Verdict::limit, 8.1, known), Verdict::limit);
  EXPECT_EQ(verdict(Verdict::limit, 11.9, known), Verdict::limit);
  EXPECT_EQ(verdict(Verdict::limit, 7.9, known), Verdict::fails);
  EXPECT_EQ(verdict(Verdict::limit, 12.1, known), Verdict::fails);
  EXPECT_EQ(verdict(Verdict::limit, NAN, known), Verdict::fails);
  EXPECT_EQ(verdict(Verdict::limit, std::nullopt, known), Verdict::fails);
  EXPECT_EQ(verdict(Verdict::limit, 10, known, "a.c"), Verdict::fails);
  EXPECT_EQ(verdict(Verdict::limit, 99, none), Verdict::limit);
  EXPECT_EQ(verdict(Verdict::holds, 99, known), Verdict::holds);
  EXPECT_TRUE(recordedLimits("a device that nobody measured").empty());
  EXPECT_FALSE(recordedLimits("llvmpipe (LLVM 15.0.6, 256 bits)").empty());
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
