// SPDX-License-Identifier: Apache-2.0
// SIGINT and SIGTERM. Long loops call throwIfInterrupted() between pieces of work, so that what is
// already computed can be kept. The flag is the one piece of process-wide state, since a signal
// handler can reach nothing else.
#pragma once

namespace probelab {

void installInterruptHandler();
bool interruptRequested();
// Throws Interrupted once a signal has arrived.
void throwIfInterrupted();

}  // namespace probelab
