#include "core/odometry/voxel_downsample.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

/// Cubes of space that are taken, 64 to a brick of 4 x 4 x 4: points that were measured one after
/// the other mostly share a brick, and no look-up is needed for them.
class TakenCubes {
 public:
  explicit TakenCubes(std::size_t max_cubes)
      : slots_(std::max<std::size_t>(min_slots, std::bit_ceil(max_cubes / 4))) {}

  /// Whether it was free until now. `cube` is a packed index.
  bool take(std::uint64_t cube) {
    constexpr std::uint64_t in_brick = packed_index(3, 3, 3);
    if ((cube & ~in_brick) != brick_) go_to(cube & ~in_brick);
    const std::uint64_t place = (cube >> 42 & 3) << 4 | (cube >> 21 & 3) << 2 | (cube & 3);
    const std::uint64_t bit = std::uint64_t{1} << place;
    const bool was_free = (taken_ & bit) == 0;
    taken_ |= bit;
    return was_free;
  }

 private:
  static constexpr std::size_t min_slots = 256;
  static constexpr std::uint64_t unused = ~std::uint64_t{0};
  struct Slot {
    std::uint64_t brick = unused;
    std::uint64_t taken = 0;
  };

  [[nodiscard]] std::size_t slot_of(std::uint64_t brick) const {
    std::size_t slot = IndexHash{}(brick) & (slots_.size() - 1);
    while (slots_[slot].brick != unused && slots_[slot].brick != brick)
      slot = (slot + 1) & (slots_.size() - 1);
    return slot;
  }
  void go_to(std::uint64_t brick) {
    if (brick_ != unused) slots_[slot_].taken = taken_;
    brick_ = brick;
    slot_ = slot_of(brick);
    taken_ = slots_[slot_].taken;
    if (slots_[slot_].brick == brick) return;
    slots_[slot_].brick = brick;
    if (2 * ++bricks_ > slots_.size()) grow();
  }
  void grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old)
      if (slot.brick != unused) slots_[slot_of(slot.brick)] = slot;
    slot_ = slot_of(brick_);
  }

  std::vector<Slot> slots_;
  std::size_t bricks_ = 0;
  /// The last brick: what is taken of it, and where that belongs.
  std::uint64_t brick_ = unused;
  std::uint64_t taken_ = 0;
  std::size_t slot_ = 0;
};

/// Numbers 0 to n - 1, each once, as their bits in reverse order count (van der Corput): whichever
/// numbers lie beside each other, the smaller one is as often the later as the earlier.
class ScatteredOrder {
 public:
  explicit ScatteredOrder(std::size_t n) : size_(n), top_bit_(std::bit_ceil(n) / 2) {}
  std::size_t next() {
    const std::size_t here = next_;
    do {
      std::size_t bit = top_bit_;
      for (; (next_ & bit) != 0; bit >>= 1) next_ ^= bit;
      next_ |= bit;
    } while (next_ >= size_);
    return here;
  }

 private:
  std::size_t size_;
  std::size_t top_bit_;
  std::size_t next_ = 0;
};

/// The same of many things, by windows of neighbours, which stay in the processor's cache.
class ScatteredWindows {
 public:
  explicit ScatteredWindows(std::size_t n)
      : size_(n), windows_((n + window_size - 1) / window_size), in_window_(0) {}
  std::size_t next() {
    if (left_ == 0) {
      first_ = windows_.next() * window_size;
      left_ = std::min(window_size, size_ - first_);
      in_window_ = ScatteredOrder(left_);
    }
    --left_;
    return first_ + in_window_.next();
  }

 private:
  static constexpr std::size_t window_size = 128;
  std::size_t size_;
  std::size_t first_ = 0;
  std::size_t left_ = 0;
  ScatteredOrder windows_;
  ScatteredOrder in_window_;
};

/// The cubes of some points, worked out at once in vector registers, and which of them are not
/// those of the points before.
class CubeBatch {
 public:
  static constexpr std::size_t capacity = 64;

  explicit CubeBatch(float inverse_spacing) : inverse_spacing_(inverse_spacing) {}

  /// At most `capacity` of them. Returns a bit for each that lies in another cube than the one
  /// before, of the last batch for the first.
  [[nodiscard]] std::uint64_t place(std::span<const Eigen::Vector3f> points,
                                    std::span<const std::uint32_t> some) {
    std::array<float, capacity> x{}, y{}, z{};
    for (std::size_t k = 0; k < some.size(); ++k) {
      const Eigen::Vector3f& p = points[some[k]];
      x[k] = p.x();
      y[k] = p.y();
      z[k] = p.z();
    }
    for (auto* const cubes : {&x_, &y_, &z_}) (*cubes)[0] = (*cubes)[last_];
    last_ = some.size();
    for (std::size_t k = 0; k < capacity; ++k) {
      x_[k + 1] = static_cast<std::int32_t>(std::floor(x[k] * inverse_spacing_));
      y_[k + 1] = static_cast<std::int32_t>(std::floor(y[k] * inverse_spacing_));
      z_[k + 1] = static_cast<std::int32_t>(std::floor(z[k] * inverse_spacing_));
    }
    std::array<std::uint8_t, capacity> differs;
    for (std::size_t k = 0; k < capacity; ++k)
      differs[k] = ((x_[k] ^ x_[k + 1]) | (y_[k] ^ y_[k + 1]) | (z_[k] ^ z_[k + 1])) != 0 ? 1 : 0;
    std::uint64_t bits = 0;
    for (std::size_t first = 0; first < capacity; first += 8) {
      // Eight bytes that are 0 or 1 become the upper eight bits of a product.
      static_assert(std::endian::native == std::endian::little);
      std::uint64_t bytes;
      std::memcpy(&bytes, &differs[first], sizeof(bytes));
      bits |= (bytes * 0x0102040810204080ULL >> 56U) << first;
    }
    return some.size() == capacity ? bits : bits & ((std::uint64_t{1} << some.size()) - 1);
  }
  /// The packed index of the k-th.
  [[nodiscard]] std::uint64_t cube(std::size_t k) const {
    return packed_index(x_[k + 1], y_[k + 1], z_[k + 1]);
  }

 private:
  using Cubes = std::array<std::int32_t, capacity + 1>;

  float inverse_spacing_;
  /// From the second on; the first ones are the last of the batch before.
  Cubes x_{}, y_{}, z_{};
  std::size_t last_ = 0;
};

/// Points that follow each other in the order of the scan and lie in one cube.
struct Run {
  std::uint64_t cube;
  std::uint32_t middle;
};

std::vector<Run> runs_in_cubes(std::span<const Eigen::Vector3f> points,
                               std::span<const std::uint32_t> chosen, float inverse_spacing) {
  std::vector<Run> runs(chosen.size());
  std::size_t count = 0;
  std::size_t run_begin = 0;
  std::uint64_t last_cube = 0;
  const auto end_run = [&](std::size_t end) {
    if (end == run_begin) return;
    ++count;
    // Of two in the middle every other run takes the later one: always the earlier one would again
    // be a point on one side.
    runs[count - 1] = {last_cube, chosen[(run_begin + end - 1 + count % 2) / 2]};
    run_begin = end;
  };
  CubeBatch batch(inverse_spacing);
  for (std::size_t begin = 0; begin < chosen.size(); begin += CubeBatch::capacity) {
    const auto some = chosen.subspan(begin, std::min(CubeBatch::capacity, chosen.size() - begin));
    std::uint64_t begins = batch.place(points, some);
    if (begin == 0) begins |= 1U;
    for (; begins != 0; begins &= begins - 1) {
      const auto k = static_cast<std::size_t>(std::countr_zero(begins));
      end_run(begin + k);
      last_cube = batch.cube(k);
    }
  }
  end_run(chosen.size());
  runs.resize(count);
  return runs;
}

}  // namespace

// Of each cube the run is kept that is visited first, in no order of the scan, and of it a point in
// the middle. The first point in the scan's order lies on the side that the lidar looks at first:
// of such points every scan turned the lidar a little, always the way that it turns itself.
std::vector<std::uint32_t> voxel_downsample(std::span<const Eigen::Vector3f> points,
                                            std::span<const std::uint32_t> chosen,
                                            double spacing_m) {
  constexpr std::size_t block_size = 16384;
  const auto inverse_spacing = static_cast<float>(1.0 / spacing_m);
  const std::size_t blocks = chosen.size() / block_size + 1;
  std::vector<std::vector<Run>> of_block(blocks);
  tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t k) {
    const std::size_t begin = k * block_size;
    const auto block = chosen.subspan(begin, std::min(block_size, chosen.size() - begin));
    of_block[k] = runs_in_cubes(points, block, inverse_spacing);
  });
  std::vector<Run> runs;
  for (const auto& block : of_block) runs.insert(runs.end(), block.begin(), block.end());
  TakenCubes taken(runs.size());
  ScatteredWindows order(runs.size());
  std::vector<std::uint32_t> kept;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Run& run = runs[order.next()];
    if (taken.take(run.cube)) kept.push_back(run.middle);
  }
  return kept;
}

}  // namespace stillmap
