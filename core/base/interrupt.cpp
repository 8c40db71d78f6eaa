// SPDX-License-Identifier: Apache-2.0
#include "base/interrupt.h"

#include <atomic>
#include <csignal>

#include "base/error.h"

namespace probelab {
namespace {
std::atomic<bool> interrupt_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free);

void onSignal(int signal) {
  interrupt_requested = true;
  std::signal(signal, SIG_DFL);  // a second one ends the program at once
}
}  // namespace

void installInterruptHandler() {
  // Without SA_RESTART: waiting for a pipe that nobody writes to ends as well.
  struct sigaction action {};
  action.sa_handler = onSignal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction hangup {};
  sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);  // not under nohup
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond a limit fails instead
}

bool interruptRequested() { return interrupt_requested; }

void throwIfInterrupted() {
  if (interrupt_requested) throw Interrupted();
}

bool endsInterrupted(const std::function<void()>& work) {
  try {
    work();
    return false;
  } catch (const Interrupted&) {
    return true;
  }
}

}  // namespace probelab
