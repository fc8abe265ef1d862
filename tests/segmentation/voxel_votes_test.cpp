#include "core/segmentation/voxel_votes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <random>
#include <tuple>
#include <vector>

namespace stillmap {
namespace {

using Cell = std::tuple<int, int, int>;

Cell cell_of(const Eigen::Vector3f& point, const VoxelVoteConfig& config) {
  const auto number = [](float value, double size) {
    return static_cast<int>(std::floor(value * static_cast<float>(1.0 / size)));
  };
  return {number(point.x(), config.edge_m), number(point.y(), config.edge_m),
          number(point.z(), config.height_m)};
}

struct Ballot {
  std::array<double, semantic_class_count> votes{};
  double voters = 0.0;
};

/// By a map of all voxels, in double precision.
class Reference {
 public:
  Reference(const std::vector<Eigen::Vector3f>& points, const VoxelVoteConfig& config,
            const PointLabels& labels)
      : config_(config) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (labels.classes[i] == SemanticClass::unlabeled) continue;
      Ballot& ballot = cells_[cell_of(points[i], config)];
      ballot.votes[static_cast<std::size_t>(labels.classes[i])] += labels.confidence[i];
      ballot.voters += 1.0;
    }
  }

  [[nodiscard]] Ballot around(const Eigen::Vector3f& point) const {
    const auto [x, y, z] = cell_of(point, config_);
    Ballot sum;
    for (const auto& [dx, dy] : {std::pair{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      for (int dz = -1; dz <= 1; ++dz) {
        const auto found = cells_.find({x + dx, y + dy, z + dz});
        if (found == cells_.end()) continue;
        const bool own = dx == 0 && dy == 0 && dz == 0;
        const double weight = own ? 1.0 : config_.neighbour_weight;
        for (std::size_t k = 0; k < semantic_class_count; ++k) {
          sum.votes[k] += weight * found->second.votes[k];
        }
        sum.voters += weight * found->second.voters;
      }
    }
    return sum;
  }

 private:
  VoxelVoteConfig config_;
  std::map<Cell, Ballot> cells_;
};

struct RandomCloud {
  std::vector<Eigen::Vector3f> points;
  PointLabels labels;

  RandomCloud(unsigned seed, std::size_t count, float extent_m) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-extent_m, extent_m);
    std::uniform_real_distribution<float> share(0.0F, 1.0F);
    std::uniform_int_distribution<int> label(-2, 19);
    for (std::size_t i = 0; i < count; ++i) {
      points.emplace_back(place(random), place(random), 0.3F * place(random));
      labels.classes.push_back(static_cast<SemanticClass>(std::max(0, label(random))));
      labels.confidence.push_back(share(random));
    }
  }
};

// Where the two leading classes are apart by more than rounding.
void expect_like_reference(const RandomCloud& cloud, const VoxelVoteConfig& config) {
  const Reference reference(cloud.points, config, cloud.labels);
  PointLabels voted = cloud.labels;
  vote_in_voxels(cloud.points, config, voted);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const SemanticClass before = cloud.labels.classes[i];
    if (before == SemanticClass::unlabeled) {
      EXPECT_EQ(voted.classes[i], before);
      continue;
    }
    const Ballot ballot = reference.around(cloud.points[i]);
    double all = 0.0;
    for (const double votes : ballot.votes) all += votes;
    std::array<double, semantic_class_count> claims = ballot.votes;
    const auto own = static_cast<std::size_t>(before);
    claims[own] += config.own_weight * static_cast<double>(cloud.labels.confidence[i]) * all;
    std::vector<double> order(claims.begin(), claims.end());
    std::ranges::sort(order, std::greater<>());
    if (order[0] - order[1] < 1e-5 * all) continue;
    const auto winner = static_cast<std::size_t>(std::ranges::max_element(claims) - claims.begin());
    EXPECT_EQ(static_cast<std::size_t>(voted.classes[i]), winner) << "point " << i;
    const double confidence = winner == own ? static_cast<double>(cloud.labels.confidence[i])
                                            : ballot.votes[winner] / ballot.voters;
    EXPECT_NEAR(voted.confidence[i], confidence, 1e-5) << "point " << i;
    changed += winner == own ? 0U : 1U;
  }
  EXPECT_GT(changed, cloud.points.size() / 10);
}

TEST(VoxelVotes, AreThoseOfTheReference) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    expect_like_reference(RandomCloud(seed, 3000, 1.5F), {});
    expect_like_reference(RandomCloud(seed, 20'000, 3.0F),
                          {.edge_m = 0.35, .height_m = 0.5, .neighbour_weight = 0.2});
    expect_like_reference(RandomCloud(seed, 3000, 1.5F), {.own_weight = 0.05});
  }
}

TEST(VoxelVotes, OutvoteAPointAmongOthers) {
  std::vector<Eigen::Vector3f> points;
  PointLabels labels;
  for (int i = 0; i < 10; ++i) {
    points.emplace_back(5.0F + 0.01F * static_cast<float>(i), 3.05F, 0.05F);
    labels.classes.push_back(i == 4 ? SemanticClass::person : SemanticClass::pole);
    labels.confidence.push_back(i == 4 ? 0.9F : 0.6F);
  }
  vote_in_voxels(points, {}, labels);
  EXPECT_EQ(labels.classes, std::vector(10, SemanticClass::pole));
  EXPECT_NEAR(labels.confidence[4], 9 * 0.6 / 10, 1e-6);
  EXPECT_FLOAT_EQ(labels.confidence[3], 0.6F);
}

TEST(VoxelVotes, LeaveAPointThatHasNoNeighbour) {
  const std::vector<Eigen::Vector3f> points{{5, 5, 0}, {5.9F, 5, 0}, {5, 5, 0.45F}};
  PointLabels labels{.classes = {SemanticClass::car, SemanticClass::road, SemanticClass::pole},
                     .confidence = {0.1F, 1.0F, 1.0F}};
  const PointLabels before = labels;
  vote_in_voxels(points, {}, labels);
  EXPECT_EQ(labels.classes, before.classes);
  EXPECT_EQ(labels.confidence, before.confidence);
}

// The two are in one voxel; neither outvotes the other.
TEST(VoxelVotes, LeaveATie) {
  const std::vector<Eigen::Vector3f> points{{5.01F, 5.01F, 0.01F}, {5.02F, 5.01F, 0.01F}};
  PointLabels labels{.classes = {SemanticClass::fence, SemanticClass::car},
                     .confidence = {0.5F, 0.5F}};
  vote_in_voxels(points, {.own_weight = 0.0}, labels);
  EXPECT_EQ(labels.classes, (std::vector{SemanticClass::fence, SemanticClass::car}));
}

/// Of a car's point, with a road at `road` that would outvote it if they were neighbours.
SemanticClass class_beside_road(const Eigen::Vector3f& car, const Eigen::Vector3f& road) {
  const std::vector<Eigen::Vector3f> points{car, road, road};
  PointLabels labels{.classes = {SemanticClass::car, SemanticClass::road, SemanticClass::road},
                     .confidence = {0.1F, 1.0F, 1.0F}};
  vote_in_voxels(points, {}, labels);
  return labels.classes[0];
}

TEST(VoxelVotes, PassOverPointsThatLieNowhereOrTooFar) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const Eigen::Vector3f far_away(-800.1F, 3.1F, -200.05F);
  ASSERT_EQ(class_beside_road(far_away, far_away), SemanticClass::road);
  for (const Eigen::Vector3f& nowhere :
       {Eigen::Vector3f(nan, 0.1F, 0.05F), Eigen::Vector3f(0.1F, infinity, 0.05F),
        Eigen::Vector3f(0.1F, 0.1F, -infinity), Eigen::Vector3f(1e30F, 0.1F, 0.05F),
        Eigen::Vector3f(0.1F, -819.3F, 0.05F), Eigen::Vector3f(0.1F, 0.1F, 204.75F)}) {
    EXPECT_EQ(class_beside_road(nowhere, nowhere), SemanticClass::car) << nowhere.transpose();
  }
}

// After the last number of a column comes the first of the column beside.
TEST(VoxelVotes, DoNotReachFromOneColumnsTopToTheNextOnesFoot) {
  const Eigen::Vector3f top(0.1F, 0.1F, 204.75F);
  for (const float y_m : {0.1F, 0.3F, 0.5F}) {
    const Eigen::Vector3f foot(0.1F, y_m, -204.75F);
    EXPECT_EQ(class_beside_road(top, foot), SemanticClass::car) << y_m;
    EXPECT_EQ(class_beside_road(foot, top), SemanticClass::car) << y_m;
  }
}

TEST(VoxelVotes, TakeNoPoints) {
  PointLabels labels;
  vote_in_voxels({}, {}, labels);
  EXPECT_TRUE(labels.empty());
  labels = {.classes = {SemanticClass::unlabeled}, .confidence = {0.0F}};
  vote_in_voxels(std::vector<Eigen::Vector3f>{{1, 1, 1}}, {}, labels);
  EXPECT_EQ(labels.classes.front(), SemanticClass::unlabeled);
}

TEST(VoxelVotes, NameWhatIsWrongWithTheirConfiguration) {
  EXPECT_EQ(VoxelVoteConfig{}.faults(), "");
  EXPECT_EQ((VoxelVoteConfig{.edge_m = 0.0}.faults()), "edge_m = 0; must be above 0\n");
  EXPECT_EQ((VoxelVoteConfig{.height_m = NAN}.faults()), "height_m = nan; must be above 0\n");
  EXPECT_EQ((VoxelVoteConfig{.neighbour_weight = -1.0, .own_weight = 2.0}.faults()),
            "neighbour_weight = -1; must be 0..1\nown_weight = 2; must be 0..1\n");
}

constexpr std::array small_things{SemanticClass::bicycle, SemanticClass::motorcycle,
                                  SemanticClass::person, SemanticClass::bicyclist,
                                  SemanticClass::motorcyclist};

bool is_small(SemanticClass label) {
  return std::ranges::find(small_things, label) != small_things.end();
}

// Votes for small things count less: to the reference they come with so much less confidence.
void expect_unsure_like_reference(const RandomCloud& cloud, const UnsureVoteConfig& config) {
  PointLabels weighted = cloud.labels;
  for (std::size_t i = 0; i < weighted.classes.size(); ++i) {
    if (is_small(weighted.classes[i]))
      weighted.confidence[i] *= static_cast<float>(config.small_weight);
  }
  const Reference reference(cloud.points,
                            {.edge_m = config.edge_m,
                             .height_m = config.height_m,
                             .neighbour_weight = config.neighbour_weight},
                            weighted);
  PointLabels voted = cloud.labels;
  vote_where_unsure(cloud.points, config, voted);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const SemanticClass before = cloud.labels.classes[i];
    const double sure_from = is_small(before) ? config.unsure_small_below : config.unsure_below;
    if (before == SemanticClass::unlabeled ||
        static_cast<double>(cloud.labels.confidence[i]) >= sure_from) {
      EXPECT_EQ(voted.classes[i], before);
      EXPECT_EQ(voted.confidence[i], cloud.labels.confidence[i]);
      continue;
    }
    const Ballot ballot = reference.around(cloud.points[i]);
    std::array<double, semantic_class_count> order = ballot.votes;
    std::ranges::sort(order, std::greater<>());
    if (order[0] - order[1] < 1e-5 * order[0]) continue;
    const auto winner =
        static_cast<std::size_t>(std::ranges::max_element(ballot.votes) - ballot.votes.begin());
    EXPECT_EQ(static_cast<std::size_t>(voted.classes[i]), winner) << "point " << i;
    if (voted.classes[i] == before) continue;
    const double weight = is_small(voted.classes[i]) ? config.small_weight : 1.0;
    EXPECT_NEAR(voted.confidence[i], ballot.votes[winner] / weight / ballot.voters, 1e-5);
    ++changed;
  }
  EXPECT_GT(changed, cloud.points.size() / 20);
}

TEST(UnsureVotes, AreThoseOfTheReference) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    expect_unsure_like_reference(RandomCloud(seed, 3000, 3.0F), {});
    // Further than marks of columns reach before they wrap.
    expect_unsure_like_reference(RandomCloud(seed, 20'000, 40.0F),
                                 {.edge_m = 0.25, .height_m = 4.0, .unsure_below = 0.9});
    expect_unsure_like_reference(RandomCloud(seed, 3000, 3.0F),
                                 {.neighbour_weight = 0.0, .small_weight = 1.0});
  }
}

TEST(UnsureVotes, TakeAPoleFoundAsAPersonFromThere) {
  std::vector<Eigen::Vector3f> points;
  PointLabels labels;
  const auto add = [&](float z, SemanticClass label, float confidence) {
    points.emplace_back(5.0F, 3.0F, z);
    labels.classes.push_back(label);
    labels.confidence.push_back(confidence);
  };
  for (int i = 0; i < 6; ++i) add(0.05F * static_cast<float>(i), SemanticClass::person, 0.45F);
  for (int i = 6; i < 10; ++i) add(0.05F * static_cast<float>(i), SemanticClass::pole, 0.8F);
  PointLabels sure = labels;
  std::fill_n(sure.confidence.begin(), 6, 0.55F);
  const std::vector<SemanticClass> before = labels.classes;
  vote_where_unsure(points, {}, labels);
  EXPECT_EQ(labels.classes, std::vector(10, SemanticClass::pole));
  vote_where_unsure(points, {}, sure);
  EXPECT_EQ(sure.classes, before);
}

TEST(UnsureVotes, LeaveAPointAloneAndOneThatLiesNowhere) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Eigen::Vector3f> points{{5, 5, 0}, {9, 5, 0}, {nan, 5, 0}};
  PointLabels labels{.classes = {SemanticClass::person, SemanticClass::road, SemanticClass::car},
                     .confidence = {0.1F, 1.0F, 0.1F}};
  const PointLabels before = labels;
  vote_where_unsure(points, {}, labels);
  EXPECT_EQ(labels.classes, before.classes);
  EXPECT_EQ(labels.confidence, before.confidence);
}

TEST(UnsureVotes, NameFaults) {
  EXPECT_EQ(UnsureVoteConfig{}.faults(), "");
  const UnsureVoteConfig wrong{.edge_m = 0, .unsure_below = 2, .small_weight = 0};
  EXPECT_NE(wrong.faults().find("edge_m"), std::string::npos);
  EXPECT_NE(wrong.faults().find("unsure_below"), std::string::npos);
  EXPECT_NE(wrong.faults().find("small_weight"), std::string::npos);
}

}  // namespace
}  // namespace stillmap
