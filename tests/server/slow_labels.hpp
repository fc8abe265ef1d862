#pragma once

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

#include "core/segmentation/stream_labels.hpp"

namespace stillmap::test {

/// The scan's own labels, after a while that can be changed as it runs.
class SlowLabels final : public LabelSource {
 public:
  struct Behaviour {
    std::atomic<int> delay_ms{0};
    std::atomic<bool> fails{false};
    std::atomic<int> labelled{0};
  };
  explicit SlowLabels(Behaviour& behaviour) : behaviour_(behaviour) {}

  [[nodiscard]] std::string name() const override { return "slow"; }
  [[nodiscard]] PointLabels label(const Scan& scan) override {
    std::this_thread::sleep_for(std::chrono::milliseconds(behaviour_.delay_ms));
    if (behaviour_.fails) throw std::runtime_error("the network is broken");
    ++behaviour_.labelled;
    return StreamLabels().label(scan);
  }

 private:
  Behaviour& behaviour_;
};

}  // namespace stillmap::test
