#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/localization/localization_query.hpp"
#include "core/localization/place_index.hpp"
#include "core/localization/place_search.hpp"
#include "core/localization/pose_evidence.hpp"

namespace stillmap {

enum class LocalizationStatus {
  /// One place fits, and no other nearly as well.
  found,
  /// Several places fit, or one that is not pinned: the scan fits some way on, too.
  ambiguous,
  /// No place fits.
  not_found,
  /// The scan shows too little, or the map has nothing to be found in.
  no_evidence,
};
[[nodiscard]] const char* name(LocalizationStatus status);

struct LocalizationConfig {
  PlaceSearchConfig search;
  /// Places that are registered.
  std::size_t places = 8;
  /// A pose is believed from here on.
  double min_explained = 0.5;
  double min_confirmed = 0.8;
  double min_level = 0.6;
  double min_score = 0.48;
  /// A place that only looks like it has walls and roofs elsewhere.
  double min_high_agreed = 0.8;
  /// Poses are registered on the map's surfaces from this score on.
  double min_registered_score = 0.3;
  /// Surfaces that leave less than this share of the score have led astray.
  double min_kept_score = 0.95;
  /// No other place reaches this share of its score.
  double max_other_share = 0.7;
  /// One that does is told apart where the best place fits so closely, and the other one less than
  /// that share of it.
  double min_close_score = 0.55;
  /// Another place is at least so far away, or turned [m, rad].
  double min_other_m = 1.5;
  double min_other_rad = 0.26;
  /// Of storeys one above another pillars and walls are the same: what only one pose explains of
  /// the scan tells, so many points at least, and so many times as many as only the other one
  /// explains.
  int min_telling_points = 30;
  int min_telling_ratio = 4;
  /// So much of the scan must stand up, and so much of the map must be in its sight.
  int min_points = 60;
  int min_map_points = 300;
};

/// A pose that was registered, with what speaks for it.
struct PlaceHypothesis {
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  PoseEvidence evidence;
  /// Of the search, before registration.
  double search_score = 0.0;
  /// What the scan shows does not pin it: it lies about as well some way on.
  bool may_slide = false;
};

/// Whether two poses are of different places.
[[nodiscard]] bool is_other_place(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b,
                                  const LocalizationConfig& config);
/// What evidence says of places apart from one another, the best first. `is_guessed`: somebody said
/// where it is, which tells what the scan does not show.
[[nodiscard]] LocalizationStatus judge_places(std::span<const PlaceHypothesis> places,
                                              const LocalizationConfig& config,
                                              bool is_guessed = false);
/// Whether a pose can be believed by its evidence alone, whatever other places there are.
[[nodiscard]] bool is_believed(const PoseEvidence& evidence, const LocalizationConfig& config);
/// Of places sorted by score: where only what is high denies the first one, the best one that is
/// believed comes before it. The first one stays its rival.
void put_believed_first(std::vector<PlaceHypothesis>& places, const LocalizationConfig& config);

struct LocalizationResult {
  LocalizationStatus status = LocalizationStatus::no_evidence;
  /// The best first; places apart from one another.
  std::vector<PlaceHypothesis> places;
};

/// Finds a scan in a whole map with no prior pose. Thread-safe.
class Localizer {
 public:
  explicit Localizer(std::shared_ptr<const PlaceIndex> index,
                     const LocalizationConfig& config = {});

  /// `scan` is prepared (see drop_unusable_points), `labels` may be empty. Throws what the index's
  /// tiles throw.
  [[nodiscard]] LocalizationResult localize(
      const Scan& scan, const PointLabels& labels,
      const Eigen::Matrix3d& R_body_lidar = Eigen::Matrix3d::Identity()) const {
    return localize(LocalizationQuery(scan, labels, R_body_lidar));
  }
  /// The same, in a part of the map where one is given.
  [[nodiscard]] LocalizationResult localize(
      const LocalizationQuery& query,
      const std::optional<SearchRegion>& region = std::nullopt) const;
  /// The same, at places where the scan is known to be if anywhere: each is within a metre of one.
  [[nodiscard]] LocalizationResult localize_at(const LocalizationQuery& query,
                                               std::span<const PlaceHypothesis> places) const;
  /// Registers a scan at a pose within a metre of its own, and asks for evidence there.
  [[nodiscard]] PlaceHypothesis align_at(const LocalizationQuery& query,
                                         const Eigen::Isometry3d& T_map_lidar) const;

  [[nodiscard]] const LocalizationConfig& config() const { return config_; }

 private:
  /// Places that were registered, in any order.
  [[nodiscard]] LocalizationResult judged(const LocalizationQuery& query,
                                          std::vector<PlaceHypothesis> places) const;
  /// Where there are storeys: the same place on the others, too, whether or not the search found it
  /// there.
  void add_other_storeys(const LocalizationQuery& query,
                         std::vector<PlaceHypothesis>& places) const;
  /// Of places one above another, those go that what differs between them denies. The best first.
  void drop_denied_storeys(const LocalizationQuery& query,
                           std::vector<PlaceHypothesis>& places) const;

  std::shared_ptr<const PlaceIndex> index_;
  LocalizationConfig config_;
};

}  // namespace stillmap
