// SPDX-License-Identifier: Apache-2.0
// SIGINT, SIGTERM and SIGHUP. Long loops call throwIfInterrupted() between pieces of work, so that
// what is already computed can be kept. The flag is the one piece of process-wide state, since a
// signal handler can reach nothing else.
#pragma once

#include <functional>

namespace probelab {

void installInterruptHandler();
bool interruptRequested();
// Throws Interrupted once a signal has arrived.
void throwIfInterrupted();
// Does the work; true when a signal ended it early, for results of which a part is worth keeping.
bool endsInterrupted(const std::function<void()>& work);

}  // namespace probelab
