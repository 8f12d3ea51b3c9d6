#include "components/lidar_odometry/worker_pool.hpp"

namespace adit::lidar_odometry {

WorkerPool::WorkerPool(int threads) {
  for (int i = 1; i < threads; ++i) threads_.emplace_back([this] { worker(); });
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  started_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerPool::run_shared(std::size_t chunks, Function function, const void* context) {
  {
    const std::lock_guard lock(mutex_);
    function_ = function;
    context_ = context;
    chunks_ = chunks;
    next_.store(0, std::memory_order_relaxed);
    busy_ = threads_.size();
    ++generation_;
  }
  started_.notify_all();
  drain();
  std::unique_lock lock(mutex_);
  finished_.wait(lock, [this] { return busy_ == 0; });
}

void WorkerPool::drain() {
  for (std::size_t i = next_.fetch_add(1); i < chunks_; i = next_.fetch_add(1)) function_(context_, i);
}

void WorkerPool::worker() {
  std::size_t seen = 0;
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      started_.wait(lock, [&] { return stop_ || generation_ != seen; });
      if (stop_) return;
      seen = generation_;
    }
    drain();
    const std::lock_guard lock(mutex_);
    if (--busy_ == 0) finished_.notify_one();
  }
}

}  // namespace adit::lidar_odometry
