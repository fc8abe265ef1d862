#include "core/graph/upright_image.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

constexpr auto cell = static_cast<float>(UprightImage::cell_m);
/// Height of a cell's points above which something stands up in it [m].
constexpr float min_height_m = 0.7F;
constexpr double yaw_step_rad = std::numbers::pi / 180.0;

/// Upright cells of an image with room round them: 2 where something stands, 1 beside it.
class ScoreGrid {
 public:
  /// Shifts go up to `reach` cells.
  ScoreGrid(const UprightImage& image, int reach)
      : reach_(reach),
        room_(2 * reach + 1),
        columns_(image.columns() + 2 * room_),
        rows_(image.rows() + 2 * room_),
        scores_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {
    for (int row = 0; row < image.rows(); ++row)
      for (int column = 0; column < image.columns(); ++column)
        if (image.is_upright(column, row)) mark(column + room_, row + room_);
  }

  /// Where a cell of the image is in it; nothing where no shift brings it to the image.
  [[nodiscard]] std::optional<std::int32_t> place(int column, int row) const {
    const int c = column + room_;
    const int r = row + room_;
    if (c < reach_ || r < reach_ || c >= columns_ - reach_ || r >= rows_ - reach_)
      return std::nullopt;
    return r * columns_ + c;
  }
  [[nodiscard]] std::int32_t shift(int columns, int rows) const {
    return rows * columns_ + columns;
  }
  [[nodiscard]] int at(std::int32_t place) const {
    return scores_[static_cast<std::size_t>(place)];
  }

 private:
  void mark(int column, int row) {
    for (int dr = -1; dr <= 1; ++dr) {
      for (int dc = -1; dc <= 1; ++dc) {
        std::uint8_t& score = scores_[static_cast<std::size_t>(shift(column + dc, row + dr))];
        const std::uint8_t value = dr == 0 && dc == 0 ? 2 : 1;
        score = std::max(score, value);
      }
    }
  }

  int reach_;
  int room_;
  int columns_;
  int rows_;
  std::vector<std::uint8_t> scores_;
};

/// Cells of `a` that what stands up in `b` falls into, as places in the grid.
std::vector<std::int32_t> places_of(const UprightImage& a, const UprightImage& b,
                                    const Eigen::Isometry2f& T_a_b, const ScoreGrid& grid) {
  std::vector<std::int32_t> places;
  places.reserve(b.upright_submap().size());
  for (const Eigen::Vector2f& p_b : b.upright_submap()) {
    const Eigen::Vector2f p = (T_a_b * p_b - a.corner_submap()) / cell;
    const auto place =
        grid.place(static_cast<int>(std::floor(p.x())), static_cast<int>(std::floor(p.y())));
    if (place) places.push_back(*place);
  }
  return places;
}

Eigen::Isometry2d moved(const Eigen::Isometry2d& T, double yaw_rad, int columns, int rows) {
  Eigen::Isometry2d out = Eigen::Isometry2d::Identity();
  out.linear() = Eigen::Rotation2Dd(yaw_rad).toRotationMatrix() * T.linear();
  out.translation() = T.translation() + UprightImage::cell_m * Eigen::Vector2d(columns, rows);
  return out;
}

}  // namespace

UprightImage::UprightImage(std::span<const Eigen::Vector3f> points_submap) {
  if (points_submap.empty()) return;
  Eigen::AlignedBox2f box;
  for (const Eigen::Vector3f& p : points_submap) box.extend(p.head<2>());
  corner_ = (box.min() / cell).array().floor() * cell;
  const Eigen::Vector2f extent = (box.max() - corner_) / cell;
  columns_ = static_cast<int>(extent.x()) + 1;
  rows_ = static_cast<int>(extent.y()) + 1;
  cells_.resize(index(0, rows_));
  for (const Eigen::Vector3f& p : points_submap) {
    const Eigen::Vector2f place = (p.head<2>() - corner_) / cell;
    Cell& here = cells_[index(static_cast<int>(place.x()), static_cast<int>(place.y()))];
    here.lowest = here.points == 0 ? p.z() : std::min(here.lowest, p.z());
    here.highest = here.points == 0 ? p.z() : std::max(here.highest, p.z());
    ++here.points;
  }
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column)
      if (is_upright(column, row)) {
        const Eigen::Vector2f centre(static_cast<float>(column) + 0.5F,
                                     static_cast<float>(row) + 0.5F);
        upright_.push_back(corner_ + cell * centre);
      }
}

bool UprightImage::is_upright(int column, int row) const {
  const Cell& here = cells_[index(column, row)];
  return here.highest - here.lowest >= min_height_m;
}

std::optional<float> UprightImage::lowest_at(const Eigen::Vector2f& p_submap) const {
  const Eigen::Vector2f place = (p_submap - corner_) / cell;
  const int column = static_cast<int>(std::floor(place.x()));
  const int row = static_cast<int>(std::floor(place.y()));
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return std::nullopt;
  const Cell& here = cells_[index(column, row)];
  if (here.points == 0) return std::nullopt;
  return here.lowest;
}

std::vector<Eigen::Vector3f> UprightImage::lowest_points() const {
  std::vector<Eigen::Vector3f> points;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Cell& here = cells_[index(column, row)];
      if (here.points == 0) continue;
      points.emplace_back(corner_.x() + cell * (static_cast<float>(column) + 0.5F),
                          corner_.y() + cell * (static_cast<float>(row) + 0.5F), here.lowest);
    }
  }
  return points;
}

PlanAlignments align_in_plan(const UprightImage& a, const UprightImage& b,
                             const Eigen::Isometry2d& T_a_b_expected, const AlignmentWindow& window,
                             double spacing_m) {
  const int reach = static_cast<int>(std::ceil(window.reach_m / UprightImage::cell_m));
  const int yaws = static_cast<int>(std::ceil(window.reach_rad / yaw_step_rad));
  const int side = 2 * reach + 1;
  const ScoreGrid grid(a, reach);
  std::vector<PlanAlignment> best_of_shift(static_cast<std::size_t>(side * side));
  const double full = 2.0 * std::max<double>(1.0, static_cast<double>(b.upright_submap().size()));
  for (int yaw = -yaws; yaw <= yaws; ++yaw) {
    const Eigen::Isometry2d T_turned = moved(T_a_b_expected, yaw * yaw_step_rad, 0, 0);
    const auto places = places_of(a, b, T_turned.cast<float>(), grid);
    for (int row = -reach; row <= reach; ++row) {
      for (int column = -reach; column <= reach; ++column) {
        const std::int32_t shift = grid.shift(column, row);
        int sum = 0;
        for (const std::int32_t place : places) sum += grid.at(place + shift);
        PlanAlignment& best =
            best_of_shift[static_cast<std::size_t>((row + reach) * side + column + reach)];
        if (sum / full <= best.score) continue;
        best = {moved(T_turned, 0.0, column, row), sum / full};
      }
    }
  }
  PlanAlignments found;
  found.best = *std::ranges::max_element(best_of_shift, {}, &PlanAlignment::score);
  for (const PlanAlignment& other : best_of_shift) {
    const double away_m = (other.T_a_b.translation() - found.best.T_a_b.translation()).norm();
    if (away_m >= spacing_m && other.score > found.runner_up.score) found.runner_up = other;
  }
  return found;
}

std::optional<double> ground_offset_m(const UprightImage& a, const UprightImage& b,
                                      const Eigen::Isometry2d& T_a_b) {
  constexpr std::size_t min_cells = 20;
  std::vector<float> offsets;
  const Eigen::Isometry2f T = T_a_b.cast<float>();
  for (const Eigen::Vector3f& p_b : b.lowest_points()) {
    if (const auto lowest_a = a.lowest_at(T * Eigen::Vector2f(p_b.head<2>())))
      offsets.push_back(*lowest_a - p_b.z());
  }
  if (offsets.size() < min_cells) return std::nullopt;
  return median_of(offsets);
}

}  // namespace stillmap
