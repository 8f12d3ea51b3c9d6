// Runs numbered chunks of work on a fixed number of threads. Which thread runs which chunk is open; results that are
// stored by chunk index and combined in index order do not depend on it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <thread>
#include <vector>

namespace adit::lidar_odometry {

class WorkerPool {
 public:
  // `threads` counts the caller of run(); 1 starts none. Precondition: threads >= 1.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Calls work(i) once for each i in [0, chunks) and returns when all are done. Allocates nothing.
  // Not to be called from two threads, or from within work. `work` must not throw.
  template <class Work>
  void run(std::size_t chunks, const Work& work) {
    if (threads_.empty() || chunks < 2) {
      for (std::size_t i = 0; i < chunks; ++i) work(i);
      return;
    }
    run_shared(
        chunks, [](const void* context, std::size_t i) { (*static_cast<const Work*>(context))(i); }, &work);
  }

 private:
  using Function = void (*)(const void*, std::size_t);
  void run_shared(std::size_t chunks, Function function, const void* context);
  void drain();
  void worker();

  std::mutex mutex_;
  std::condition_variable started_, finished_;
  std::atomic<std::size_t> next_{0};
  std::size_t chunks_ = 0;
  Function function_ = nullptr;
  const void* context_ = nullptr;
  std::size_t generation_ = 0;  // of the job, under mutex_
  std::size_t busy_ = 0;        // workers still on the current job, under mutex_
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace adit::lidar_odometry
