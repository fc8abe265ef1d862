#pragma once

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/segmentation/segmenter.hpp"

namespace stillmap::test {

/// The scan's own labels, after a while that can be changed as it runs; in images of 2000 columns
/// or a smaller share of them. One core takes as long as all.
class SlowSegmenter final : public Segmenter {
 public:
  struct Behaviour {
    std::atomic<int> delay_ms{0};
    /// It finishes no scan while this is set; notified when it is cleared.
    std::atomic<bool> is_held{false};
    std::atomic<bool> fails{false};
    std::atomic<int> labelled{0};
    std::vector<double> costs{1.0};
    std::size_t concurrent_scans = 1;
    std::atomic<int> in_work{0};
    std::atomic<int> max_in_work{0};
  };
  explicit SlowSegmenter(Behaviour& behaviour) : behaviour_(behaviour) {}

  [[nodiscard]] std::string name() const override { return "slow"; }
  [[nodiscard]] std::vector<double> relative_costs() const override { return behaviour_.costs; }
  void set_resolution_level(std::size_t resolution_level) override {
    cost_ = behaviour_.costs.at(resolution_level);
  }
  [[nodiscard]] std::size_t concurrent_scans() const override {
    return behaviour_.concurrent_scans;
  }
  [[nodiscard]] int image_columns() const override { return static_cast<int>(2000 * cost_); }
  [[nodiscard]] PointLabels segment(const Scan& scan) override {
    const int in_work = ++behaviour_.in_work;
    if (in_work > behaviour_.max_in_work) behaviour_.max_in_work = in_work;
    std::this_thread::sleep_for(
        std::chrono::duration<double, std::milli>(behaviour_.delay_ms * cost_));
    behaviour_.is_held.wait(true);
    --behaviour_.in_work;
    if (behaviour_.fails) throw std::runtime_error("the network is broken");
    ++behaviour_.labelled;
    return PassthroughSegmenter().segment(scan);
  }

 private:
  Behaviour& behaviour_;
  std::atomic<double> cost_ = 1.0;
};

}  // namespace stillmap::test
