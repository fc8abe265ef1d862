#include "core/localization/place_search.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace stillmap {
namespace {

/// Evenly thinned.
std::vector<Eigen::Vector3f> some_of(const std::vector<Eigen::Vector3f>& all, std::size_t most) {
  const std::size_t count = std::min(all.size(), most);
  std::vector<Eigen::Vector3f> some(count);
  for (std::size_t k = 0; k < count; ++k) some[k] = all[k * all.size() / count];
  return some;
}

/// Counts of landmarks in occupied cells for Width x Height poses side by side. Whole rows are
/// compared at once, as the compiler's vectors.
template <int Width, int Height>
class HitCounts {
 public:
  /// A landmark that is at `cells` for the first pose. ThreadSanitizer, which would look at every
  /// byte, is told to leave it: both ends are the caller's own.
  __attribute__((no_sanitize("thread"))) void add(const std::uint8_t* cells, int stride,
                                                  std::uint8_t layer) {
    for (int y = 0; y < Height; ++y) {
      const std::uint8_t* const row = cells + static_cast<std::ptrdiff_t>(y) * stride;
      std::uint8_t* const count = counts_.data() + static_cast<std::ptrdiff_t>(y) * Width;
      for (int x = 0; x < Width; ++x)
        count[x] = static_cast<std::uint8_t>(count[x] + ((row[x] & layer) != 0 ? 1 : 0));
    }
  }
  [[nodiscard]] int at(int x, int y) const {
    return counts_[static_cast<std::size_t>(y * Width + x)];
  }
  [[nodiscard]] const std::array<std::uint8_t, std::size_t{Width} * Height>& all() const {
    return counts_;
  }

 private:
  std::array<std::uint8_t, std::size_t{Width} * Height> counts_{};
};

/// Where the landmarks of a scan are round a pose of this heading, and how high on this ground.
class TurnedLandmarks {
 public:
  TurnedLandmarks(const std::vector<Eigen::Vector3f>& landmarks_foot, double heading_rad)
      : places_(landmarks_foot) {
    const Eigen::Rotation2Df R(static_cast<float>(heading_rad));
    for (Eigen::Vector3f& p : places_) p.head<2>() = R * p.head<2>();
  }
  [[nodiscard]] const std::vector<Eigen::Vector3f>& places() const { return places_; }

 private:
  std::vector<Eigen::Vector3f> places_;
};

/// Height of the scan's `foot` over the map's ground, which `foot` is on where the scan shows it.
double foot_height_m(const LocalizationQuery& query, const PathNode& node) {
  return query.has_ground ? 0.0 : node.body_height_m;
}

/// Landmarks may be so many coarse cells from the lidar.
constexpr int max_reach = 50;
/// The best pose of each of these parts of a block, for each of these parts of the circle.
constexpr int part_side = 4;
constexpr int sectors = 8;
constexpr int parts_x = PlaceIndex::block_width / part_side;
constexpr int parts_y = PlaceIndex::block_height / part_side;

class CoarseSearch {
 public:
  CoarseSearch(const LocalizationQuery& query, const PlaceIndex& index,
               const PlaceSearchConfig& config, const std::optional<SearchRegion>& region)
      : query_(query), index_(index), region_(region), heading_step_rad_(config.heading_step_rad) {
    const auto landmarks = some_of(query.landmarks_foot, config.coarse_landmarks);
    count_ = landmarks.size();
    headings_ =
        static_cast<int>(std::ceil(2.0 * std::numbers::pi / config.heading_step_rad / sectors)) *
        sectors;
    for (int k = 0; k < headings_; ++k) turned_.emplace_back(landmarks, heading_rad(k));
  }

  [[nodiscard]] std::vector<PlaceCandidate> run() const {
    std::vector<std::vector<PlaceCandidate>> of_block(index_.blocks().size());
    tbb::parallel_for(std::size_t{0}, of_block.size(),
                      [&](std::size_t k) { of_block[k] = search(index_.blocks()[k]); });
    std::vector<PlaceCandidate> all;
    for (const auto& found : of_block) all.insert(all.end(), found.begin(), found.end());
    return all;
  }

 private:
  using Counts = HitCounts<PlaceIndex::block_width, PlaceIndex::block_height>;
  struct Best {
    int hits = 0;
    int heading = 0;
    int x = 0;
    int y = 0;
  };
  using BestOfParts = std::array<Best, std::size_t{parts_x} * parts_y * sectors>;

  [[nodiscard]] double heading_rad(int k) const {
    return std::remainder(2.0 * std::numbers::pi * k / headings_, 2.0 * std::numbers::pi);
  }

  [[nodiscard]] Counts count(const LayeredCells::Window& window, const PlaceIndex::Block& block,
                             const TurnedLandmarks& landmarks) const {
    const double cell_m = index_.coarse().config().cell_m;
    const double layer_m = index_.coarse().config().layer_m;
    const PathNode& node = index_.nodes()[block.node];
    const Eigen::Vector2d middle =
        cell_m * Eigen::Vector2d(block.first_x + 0.5 * PlaceIndex::block_width,
                                 block.first_y + 0.5 * PlaceIndex::block_height);
    const double base_m = node.ground.at(middle - node.position_map) + foot_height_m(query_, node);
    Counts counts;
    for (const Eigen::Vector3f& p : landmarks.places()) {
      // Poses are in the middles of cells.
      const int x = static_cast<int>(std::floor(static_cast<double>(p.x()) / cell_m + 0.5));
      const int y = static_cast<int>(std::floor(static_cast<double>(p.y()) / cell_m + 0.5));
      if (std::abs(x) > max_reach || std::abs(y) > max_reach) continue;
      const double height_m =
          base_m + static_cast<double>(p.z()) + node.ground.slope.dot(p.head<2>().cast<double>());
      counts.add(window.cells.data() + static_cast<std::ptrdiff_t>(y + max_reach) * window.width +
                     (x + max_reach),
                 window.width, LayeredCells::layer_bit(height_m, layer_m));
    }
    return counts;
  }

  /// Whether a place of the block may be in the region.
  [[nodiscard]] bool is_in_region(const PlaceIndex::Block& block) const {
    if (!region_) return true;
    const double cell_m = index_.coarse().config().cell_m;
    const Eigen::Vector2d low = cell_m * Eigen::Vector2d(block.first_x, block.first_y);
    const Eigen::Vector2d high =
        low + cell_m * Eigen::Vector2d(PlaceIndex::block_width, PlaceIndex::block_height);
    const Eigen::Vector2d nearest = region_->centre_map.cwiseMax(low).cwiseMin(high);
    return (nearest - region_->centre_map).norm() <= region_->radius_m + cell_m;
  }

  [[nodiscard]] std::vector<PlaceCandidate> search(const PlaceIndex::Block& block) const {
    if (!is_in_region(block)) return {};
    const LayeredCells::Window window = index_.coarse().window(
        block.first_x - max_reach, block.first_y - max_reach,
        PlaceIndex::block_width + 2 * max_reach, PlaceIndex::block_height + 2 * max_reach);
    BestOfParts best{};
    for (int k = 0; k < headings_; ++k) {
      const Counts counts = count(window, block, turned_[static_cast<std::size_t>(k)]);
      keep_best(counts, block, k, best);
    }
    std::vector<PlaceCandidate> found;
    const double cell_m = index_.coarse().config().cell_m;
    for (const Best& b : best) {
      if (b.hits == 0) continue;
      const Eigen::Vector2d position_map =
          cell_m * Eigen::Vector2d(block.first_x + b.x + 0.5, block.first_y + b.y + 0.5);
      found.push_back({position_map, heading_rad(b.heading), block.node,
                       static_cast<double>(b.hits) / count_as_double()});
    }
    return found;
  }

  void keep_best(const Counts& counts, const PlaceIndex::Block& block, int heading,
                 BestOfParts& best) const {
    const int sector = heading / (headings_ / sectors);
    for (int y = 0; y < PlaceIndex::block_height; ++y) {
      for (int x = 0; x < PlaceIndex::block_width; ++x) {
        const int part = (y / part_side * parts_x + x / part_side) * sectors + sector;
        Best& b = best[static_cast<std::size_t>(part)];
        if (counts.at(x, y) <= b.hits) continue;
        if (block.is_searched[static_cast<std::size_t>(y * PlaceIndex::block_width + x)] == 0)
          continue;
        if (region_ && !is_in_region(block, x, y, heading)) continue;
        b = {counts.at(x, y), heading, x, y};
      }
    }
  }

  [[nodiscard]] bool is_in_region(const PlaceIndex::Block& block, int x, int y, int heading) const {
    const double cell_m = index_.coarse().config().cell_m;
    const Eigen::Vector2d position_map =
        cell_m * Eigen::Vector2d(block.first_x + x + 0.5, block.first_y + y + 0.5);
    return region_->contains(position_map, heading_rad(heading), cell_m, heading_step_rad_);
  }

  [[nodiscard]] double count_as_double() const { return static_cast<double>(count_); }

  const LocalizationQuery& query_;
  const PlaceIndex& index_;
  const std::optional<SearchRegion>& region_;
  double heading_step_rad_;
  std::size_t count_ = 0;
  int headings_ = 0;
  std::vector<TurnedLandmarks> turned_;
};

/// Round each candidate: poses as many cells as this to each side, in a row that vectors like.
constexpr int fine_width = 16;
constexpr int fine_height = 9;
constexpr int fine_headings = 5;

class FineSearch {
 public:
  FineSearch(const LocalizationQuery& query, const PlaceIndex& index,
             const PlaceSearchConfig& config)
      : query_(query),
        index_(index),
        step_rad_(config.heading_step_rad / (fine_headings - 1)),
        landmarks_(some_of(query.landmarks_foot, config.fine_landmarks)) {}

  [[nodiscard]] PlaceCandidate refine(const PlaceCandidate& coarse) const {
    const LayeredCells& cells = index_.fine();
    const double cell_m = cells.config().cell_m;
    const int reach = static_cast<int>(max_reach / cell_m);
    const PathNode& node = index_.nodes()[coarse.node];
    const double base_m =
        node.ground.at(coarse.position_map - node.position_map) + foot_height_m(query_, node);
    const int first_x = cells.index(coarse.position_map.x()) - fine_width / 2;
    const int first_y = cells.index(coarse.position_map.y()) - fine_height / 2;
    const LayeredCells::Window window = cells.window(
        first_x - reach, first_y - reach, fine_width + 2 * reach, fine_height + 2 * reach);
    PlaceCandidate best = coarse;
    best.score = 0.0;
    for (int k = 0; k < fine_headings; ++k) {
      const double heading_rad = coarse.heading_rad + (k - fine_headings / 2) * step_rad_;
      const TurnedLandmarks turned(landmarks_, heading_rad);
      HitCounts<fine_width, fine_height> counts;
      for (const Eigen::Vector3f& p : turned.places()) {
        const int x = static_cast<int>(std::floor(static_cast<double>(p.x()) / cell_m + 0.5));
        const int y = static_cast<int>(std::floor(static_cast<double>(p.y()) / cell_m + 0.5));
        if (std::abs(x) > reach || std::abs(y) > reach) continue;
        const double height_m =
            base_m + static_cast<double>(p.z()) + node.ground.slope.dot(p.head<2>().cast<double>());
        counts.add(window.cells.data() + static_cast<std::ptrdiff_t>(y + reach) * window.width +
                       (x + reach),
                   window.width, LayeredCells::layer_bit(height_m, cells.config().layer_m));
      }
      const auto most = std::ranges::max_element(counts.all());
      const double score = *most / static_cast<double>(landmarks_.size());
      if (score <= best.score) continue;
      const auto place = static_cast<int>(most - counts.all().begin());
      best.score = score;
      best.heading_rad = heading_rad;
      best.position_map = cell_m * Eigen::Vector2d(first_x + place % fine_width + 0.5,
                                                   first_y + place / fine_width + 0.5);
    }
    return best;
  }

 private:
  const LocalizationQuery& query_;
  const PlaceIndex& index_;
  double step_rad_;
  std::vector<Eigen::Vector3f> landmarks_;
};

/// Places of another storey are others [m].
constexpr double storey_spacing_m = 1.5;

bool is_better(const PlaceCandidate& a, const PlaceCandidate& b) {
  if (a.score != b.score) return a.score > b.score;
  if (a.position_map.x() != b.position_map.x()) return a.position_map.x() < b.position_map.x();
  if (a.position_map.y() != b.position_map.y()) return a.position_map.y() < b.position_map.y();
  return a.heading_rad < b.heading_rad;
}

double ground_m(const PlaceCandidate& candidate, const PlaceIndex& index) {
  const PathNode& node = index.nodes()[candidate.node];
  return node.ground.at(candidate.position_map - node.position_map);
}

std::vector<PlaceCandidate> spread(std::vector<PlaceCandidate> all, std::size_t count,
                                   const PlaceIndex& index, const PlaceSearchConfig& config) {
  std::ranges::sort(all, is_better);
  std::vector<PlaceCandidate> kept;
  for (const PlaceCandidate& c : all) {
    if (kept.size() == count) break;
    const bool is_near = std::ranges::any_of(kept, [&](const PlaceCandidate& k) {
      const double turn = std::remainder(c.heading_rad - k.heading_rad, 2.0 * std::numbers::pi);
      return (c.position_map - k.position_map).norm() < config.spacing_m &&
             std::abs(turn) < config.spacing_rad &&
             std::abs(ground_m(c, index) - ground_m(k, index)) < storey_spacing_m;
    });
    if (!is_near) kept.push_back(c);
  }
  return kept;
}

}  // namespace

bool SearchRegion::contains(const Eigen::Vector2d& position_map, double heading_map_rad,
                            double margin_m, double margin_rad) const {
  const double turn_rad = std::remainder(heading_map_rad - heading_rad, 2.0 * std::numbers::pi);
  return (position_map - centre_map).norm() <= radius_m + margin_m &&
         std::abs(turn_rad) <= max_turn_rad + margin_rad;
}

std::vector<PlaceCandidate> search_places(const LocalizationQuery& query, const PlaceIndex& index,
                                          std::size_t count, const PlaceSearchConfig& config,
                                          const std::optional<SearchRegion>& region) {
  if (index.empty() || query.landmarks_foot.empty()) return {};
  std::vector<PlaceCandidate> places = spread(CoarseSearch(query, index, config, region).run(),
                                              config.coarse_candidates, index, config);
  const FineSearch fine(query, index, config);
  tbb::parallel_for(std::size_t{0}, places.size(),
                    [&](std::size_t k) { places[k] = fine.refine(places[k]); });
  return spread(std::move(places), count, index, config);
}

Eigen::Isometry3d T_map_upright(const PlaceCandidate& candidate, const LocalizationQuery& query,
                                const PlaceIndex& index) {
  const PathNode& node = index.nodes()[candidate.node];
  const Eigen::Vector3d up =
      Eigen::Vector3d(-node.ground.slope.x(), -node.ground.slope.y(), 1.0).normalized();
  const double height_m =
      node.ground.at(candidate.position_map - node.position_map) + foot_height_m(query, node);
  Eigen::Isometry3d T_map_foot = Eigen::Isometry3d::Identity();
  T_map_foot.translation() << candidate.position_map, height_m;
  T_map_foot.linear() = (Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up) *
                         Eigen::AngleAxisd(candidate.heading_rad, Eigen::Vector3d::UnitZ()))
                            .toRotationMatrix();
  return T_map_foot * query.T_foot_upright;
}

}  // namespace stillmap
