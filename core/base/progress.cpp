// SPDX-License-Identifier: Apache-2.0
#include "base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "base/error.h"

namespace probelab {
namespace {
constexpr double kTerminalIntervalS = 0.2;
constexpr double kLogIntervalS = 10.0;
}  // namespace

std::string formatDuration(double seconds) {
  const auto s = static_cast<long>(std::lround(std::max(0.0, seconds)));
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s / 60 % 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

Progress::Progress(std::string label, double total, bool quiet)
    : label_(std::move(label)),
      total_(total),
      quiet_(quiet),
      on_terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { finish(); }

void Progress::update(double done) {
  if (quiet_) return;
  const double now = timer_.seconds();
  if (now - last_print_s_ < (on_terminal_ ? kTerminalIntervalS : kLogIntervalS)) return;
  last_print_s_ = now;
  print(done);
}

void Progress::print(double done) {
  const double share = total_ > 0 ? std::clamp(done / total_, 0.0, 1.0) : 0.0;
  const double elapsed = timer_.seconds();
  const std::string left =
      share > 0 ? ", " + formatDuration(elapsed * (1 - share) / share) + " left" : "";
  printToStderr(fmt::format("{}{}: {:3.0f} %{}{}", on_terminal_ ? "\r" : "", label_, 100 * share,
                            left, on_terminal_ ? "   \x1b[K" : "\n"));
  printed_ = true;
}

void Progress::finish() {
  if (printed_ && on_terminal_) printToStderr("\r\x1b[K");
  printed_ = false;
}

}  // namespace probelab
