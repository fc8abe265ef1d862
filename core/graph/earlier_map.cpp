#include "core/graph/earlier_map.hpp"

#include <utility>

namespace stillmap {
namespace {

/// The drive's submap turned upright by the map's vertical.
PlacedSubmap levelled(const Submap& submap, const Eigen::Isometry3d& T_map_key) {
  Submap turned = submap;
  turned.T_submap_key = upright_from_key(T_map_key);
  const Eigen::Isometry3f T = (turned.T_submap_key * submap.T_submap_key.inverse()).cast<float>();
  for (Eigen::Vector3f& p : turned.points_submap) p = T * p;
  return PlacedSubmap(std::move(turned));
}

}  // namespace

std::optional<EarlierMap::Match> EarlierMap::match(const Submap& submap,
                                                   const Eigen::Isometry3d& T_map_key_told,
                                                   double way_m) const {
  // Often that of the match before: rounding that made it no rotation any more would be three times
  // as large in this one, and two percent after thirty.
  const Eigen::Isometry3d T_map_key_expected =
      Eigen::Translation3d(T_map_key_told.translation()) *
      Eigen::Quaterniond(T_map_key_told.linear()).normalized();
  Submap round = piece_round(T_map_key_expected);
  if (round.points_submap.empty()) return std::nullopt;
  const PlacedSubmap piece(std::move(round));
  const PlacedSubmap mine = levelled(submap, T_map_key_expected);
  // Both frames are that of the expected pose, upright.
  auto found = match_submaps(piece, mine, Eigen::Isometry3d::Identity(),
                             window_after(config_.drift, way_m), config_.match);
  if (!found) return std::nullopt;
  const Eigen::Isometry3d T_map_piece = T_map_key_expected * piece.submap.T_submap_key.inverse();
  return Match{T_map_piece * found->T_a_b * mine.submap.T_submap_key, *std::move(found)};
}

Submap EarlierMap::piece_round(const Eigen::Isometry3d& T_map_key) const {
  Submap piece;
  piece.T_submap_key = upright_from_key(T_map_key);
  const Eigen::Isometry3d T_piece_map = piece.T_submap_key * T_map_key.inverse();
  const auto points = points_near_(T_map_key.translation().head<2>(), config_.piece_radius_m);
  piece.points_submap.reserve(points.size());
  piece.classes.reserve(points.size());
  for (const LabelledPoint& point : points) {
    piece.points_submap.push_back((T_piece_map * point.position_map.cast<double>()).cast<float>());
    piece.classes.push_back(point.label);
  }
  return piece;
}

}  // namespace stillmap
