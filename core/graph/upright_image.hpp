#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace stillmap {

/// A submap from above: which cells hold something that stands up, and how high the ground is.
class UprightImage {
 public:
  static constexpr double cell_m = 0.5;

  /// Points in an upright frame [m].
  explicit UprightImage(std::span<const Eigen::Vector3f> points_submap);

  /// Centres of the cells with something upright in them [m].
  [[nodiscard]] const std::vector<Eigen::Vector2f>& upright_submap() const { return upright_; }
  [[nodiscard]] bool is_upright(int column, int row) const;
  /// Lowest point in the cell [m], nothing where there is none.
  [[nodiscard]] std::optional<float> lowest_at(const Eigen::Vector2f& p_submap) const;
  /// Cells with any point, and their lowest ones [m].
  [[nodiscard]] std::vector<Eigen::Vector3f> lowest_points() const;

  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  /// Corner of cell 0, 0 [m].
  [[nodiscard]] const Eigen::Vector2f& corner_submap() const { return corner_; }

  [[nodiscard]] std::size_t bytes() const {
    return sizeof(*this) + cells_.capacity() * sizeof(Cell) +
           upright_.capacity() * sizeof(Eigen::Vector2f);
  }

 private:
  struct Cell {
    float lowest = 0.0F;
    float highest = 0.0F;
    std::uint32_t points = 0;
  };
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  Eigen::Vector2f corner_ = Eigen::Vector2f::Zero();
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Cell> cells_;
  std::vector<Eigen::Vector2f> upright_;
};

/// How far from the expected place one submap is looked for in another.
struct AlignmentWindow {
  double reach_m = 5.0;
  double reach_rad = 0.05;
  /// In height: beyond it the place that looks alike is another storey.
  double reach_height_m = 2.5;
  /// There may be other levels above and below the place: the lowest ground says nothing where it
  /// is beyond the reach in height.
  bool has_levels = false;
};

/// Where one submap lies in another, in plan.
struct PlanAlignment {
  /// p_a = T_a_b * p_b.
  Eigen::Isometry2d T_a_b = Eigen::Isometry2d::Identity();
  /// Share of what stands up in b that stands up in a, too; half for those a cell off.
  double score = 0.0;
};

/// The best alignment, then the best one that is at least `spacing_m` away from it.
struct PlanAlignments {
  PlanAlignment best;
  PlanAlignment runner_up;
};

/// Judges every shift of a cell and turn of a degree in the window (correlative scan matching, E.
/// Olson, ICRA 2009), so that the runner-up tells how sure the best one is.
[[nodiscard]] PlanAlignments align_in_plan(const UprightImage& a, const UprightImage& b,
                                           const Eigen::Isometry2d& T_a_b_expected,
                                           const AlignmentWindow& window, double spacing_m = 2.5);

/// How much higher the ground of a is than that of b where they overlap: median [m]. Nothing where
/// they do not.
[[nodiscard]] std::optional<double> ground_offset_m(const UprightImage& a, const UprightImage& b,
                                                    const Eigen::Isometry2d& T_a_b);

}  // namespace stillmap
