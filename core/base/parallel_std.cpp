// SPDX-License-Identifier: Apache-2.0
// parallelFor on std::thread, in place of parallel.cpp: the thread sanitizer cannot see inside TBB,
// whose library is not instrumented, but it sees every hand-over of this.
#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "base/parallel.h"

namespace probelab {
namespace {

std::atomic<int> limit{0};
thread_local bool is_worker = false;

}  // namespace

void parallelFor(std::size_t count, std::size_t grain,
                 const std::function<void(std::size_t, std::size_t)>& body) {
  if (count == 0) return;
  grain = std::max<std::size_t>(grain, 1);
  const std::size_t blocks = (count + grain - 1) / grain;
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::size_t block; (block = next++) < blocks;) try {
        body(block * grain, std::min(count, (block + 1) * grain));
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
        next = blocks;
      }
  };
  const std::size_t threads = is_worker ? 1 : std::min<std::size_t>(blocks, threadCount());
  std::vector<std::thread> workers;
  for (std::size_t i = 1; i < threads; ++i)
    workers.emplace_back([&] {
      is_worker = true;
      work();
    });
  work();
  for (std::thread& worker : workers) worker.join();
  if (failure) std::rethrow_exception(failure);
}

struct ThreadLimit::Impl {
  int before = 0;
  ~Impl() { limit = before; }
};

ThreadLimit::ThreadLimit(int threads) : impl_(std::make_unique<Impl>()) {
  impl_->before = limit;
  if (threads > 0) limit = threads;
}
ThreadLimit::~ThreadLimit() = default;
ThreadLimit::ThreadLimit(ThreadLimit&&) noexcept = default;

// At least four, so that there is something to see on a small machine.
int threadCount() {
  const int all = std::max(4, static_cast<int>(std::thread::hardware_concurrency()));
  return limit > 0 ? limit.load() : all;
}

}  // namespace probelab
