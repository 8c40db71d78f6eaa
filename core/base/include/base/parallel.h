// SPDX-License-Identifier: Apache-2.0
// Parallel loops over index ranges. A body must write only to its own indices; then the result does
// not depend on the number of threads.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace probelab {

// Calls body(begin, end) for disjoint ranges covering [0, count), each of at most `grain` indices
// and starting at a multiple of `grain`. Exceptions of the body are rethrown here.
void parallelFor(std::size_t count, std::size_t grain,
                 const std::function<void(std::size_t begin, std::size_t end)>& body);

// Limits the threads of parallelFor while it lives. threads = 0: all of the machine's.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(ThreadLimit&&) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Threads that parallelFor uses now.
int threadCount();

}  // namespace probelab
