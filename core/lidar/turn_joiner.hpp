#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/lidar/turn_parts.hpp"

namespace stillmap {

/// Makes scans of one lidar's clouds where these are parts of turns, and lets whole ones pass.
/// Until it knows what they are, clouds that go on where the last one ended wait for those to come,
/// two turns at most; a lidar that looks round waits for none, and one that looks one way for one.
class TurnJoiner {
 public:
  /// Finds out from the clouds how many make a turn.
  static constexpr std::uint32_t automatic = 0;

  /// More are no turns that anybody publishes in parts.
  static constexpr std::uint32_t most = 200;

  explicit TurnJoiner(std::size_t clouds_per_turn = automatic);

  /// Takes a cloud; returns the scans that are complete by it, in their order.
  [[nodiscard]] std::vector<Scan> add(Scan cloud);
  /// What waits for more, which do not come.
  [[nodiscard]] std::vector<Scan> flush();

  /// 1: each cloud is a scan; 0: not known yet.
  [[nodiscard]] std::size_t clouds_per_turn() const { return clouds_per_turn_; }

 private:
  void settle(std::size_t clouds_per_turn);
  /// The clouds of the turn that is under way.
  void release(std::vector<Scan>& scans);

  bool is_told_;
  std::size_t clouds_per_turn_;
  TurnRecognition recognition_;
  TurnCounter counter_;
  /// Of the turn under way.
  std::vector<Scan> parts_;
  /// Before it is known what they are.
  std::vector<Scan> waiting_;
};

}  // namespace stillmap
