// SPDX-License-Identifier: Apache-2.0
// Progress with the time left, on stderr: one rewritten line on a terminal, otherwise a line every
// ten seconds.
#pragma once

#include <string>

#include "base/timer.h"

namespace probelab {

class Progress {
 public:
  // `total` in any unit of work; quiet progress prints nothing.
  Progress(std::string label, double total, bool quiet = false);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Work done so far, in the unit of `total`. Call from one thread.
  void update(double done);
  void finish();

 private:
  void print(double done);

  std::string label_;
  double total_;
  bool quiet_;
  bool on_terminal_;
  bool printed_ = false;
  double last_print_s_ = 0;
  Timer timer_;
};

// "1 h 04 min", "3 min 20 s", "12 s".
std::string formatDuration(double seconds);

}  // namespace probelab
