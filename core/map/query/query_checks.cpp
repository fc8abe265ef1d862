#include "core/map/query/query_checks.hpp"

#include <xxhash.h>

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <sstream>

namespace stillmap {
namespace {

constexpr std::size_t word_digits = 16;
constexpr std::size_t word_count = 6;
using TokenWords = std::array<std::uint64_t, word_count>;

std::uint64_t checksum(const TokenWords& words) { return XXH3_64bits(words.data(), sizeof(words)); }

void append_word(std::string& token, std::uint64_t word) {
  std::array<char, word_digits> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), word, 16).ptr;
  const auto length = static_cast<std::size_t>(end - digits.data());
  token.append(word_digits - length, '0').append(digits.data(), length);
}

std::optional<std::uint64_t> parse_word(const std::string& token, std::size_t index) {
  const char* begin = token.data() + index * word_digits;
  std::uint64_t word = 0;
  const auto [end, error] = std::from_chars(begin, begin + word_digits, word, 16);
  if (error != std::errc{} || end != begin + word_digits) return std::nullopt;
  return word;
}

/// Resolutions that differ by less are the same: one came over the wire as float.
constexpr double resolution_tolerance = 1e-6;

void check_resolution(const MapSnapshot& view, const MapQuery& query, std::ostream& faults) {
  const double resolution_m = query.resolution_m;
  const double finest_m = view.voxel_size_m * (1.0 - resolution_tolerance);
  if (resolution_m != 0.0 && !(resolution_m >= finest_m && std::isfinite(resolution_m))) {
    faults << "resolution_m is " << resolution_m << "; must be 0 (the map's own) or from "
           << view.voxel_size_m << " up. ";
  } else if (query.since && is_coarser_than_map(view, resolution_m)) {
    faults << "resolution_m is " << resolution_m
           << "; with since_version it must be 0, the map's own: larger cells belong to no tile. ";
  }
}

/// What a query consists of, as whole numbers one after the other.
class QueryWords {
 public:
  void add(std::uint64_t word) { words_.push_back(word); }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
  void add(const HeightRange& heights) {
    add(heights.min_m);
    add(heights.max_m);
  }
  void add(const std::vector<Eigen::Vector2d>& points) {
    for (const Eigen::Vector2d& point : points) {
      add(point.x());
      add(point.y());
    }
  }
  void add(const BoxRegion& box) {
    for (const double value : box.box_map.min()) add(value);
    for (const double value : box.box_map.max()) add(value);
  }
  void add(const SphereRegion& sphere) {
    for (const double value : sphere.centre_map) add(value);
    add(sphere.radius_m);
  }
  void add(const PolygonRegion& polygon) {
    add(polygon.heights);
    add(polygon.corners_map);
  }
  void add(const CorridorRegion& corridor) {
    add(corridor.heights);
    add(corridor.half_width_m);
    add(corridor.path_map);
  }

  [[nodiscard]] std::uint64_t hash() const {
    return XXH3_64bits(words_.data(), words_.size() * sizeof(words_[0]));
  }

 private:
  std::vector<std::uint64_t> words_;
};

}  // namespace

std::string to_token(const Continuation& c) {
  const TokenWords words{c.map_id,       c.map_version, c.query_fingerprint,
                         c.total_voxels, c.tile,        c.voxel};
  std::string token;
  for (const std::uint64_t word : words) append_word(token, word);
  append_word(token, checksum(words));
  return token;
}

std::optional<Continuation> from_token(const std::string& token) {
  if (token.size() != (word_count + 1) * word_digits) return std::nullopt;
  TokenWords words{};
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto word = parse_word(token, i);
    if (!word) return std::nullopt;
    words.at(i) = *word;
  }
  if (parse_word(token, word_count) != checksum(words)) return std::nullopt;
  return Continuation{words[0], words[1], words[2], words[3], words[4], words[5]};
}

bool is_coarser_than_map(const MapSnapshot& view, double resolution_m) {
  return resolution_m > view.voxel_size_m * (1.0 + resolution_tolerance);
}

std::string query_faults(const MapSnapshot& view, const MapQuery& query) {
  std::ostringstream faults;
  faults << region_faults(query.region);
  check_resolution(view, query, faults);
  if (query.max_bytes < query_voxel_bytes) {
    faults << "max_bytes is " << query.max_bytes << "; must be at least " << query_voxel_bytes
           << ", the size of one voxel. ";
  }
  return faults.str();
}

std::optional<Refusal> since_refusal(const MapSnapshot& view, const KnownVersion& since,
                                     const TileHistory* history) {
  std::ostringstream reason;
  if (since.map_id != view.map_id) {
    reason << "since_map_id is " << since.map_id << ", the map is now " << view.map_id;
  } else if (since.version > view.version) {
    reason << "since_version is " << since.version << ", the map is at version " << view.version;
  } else if (history == nullptr || since.version < history->known_since) {
    reason << "since_version is " << since.version << "; changes are remembered since version "
           << (history == nullptr ? view.version : history->known_since);
  } else {
    return std::nullopt;
  }
  reason << "; ask for everything, without since_version";
  return Refusal{QueryStatus::changes_unknown, reason.str()};
}

std::optional<Refusal> token_refusal(const MapSnapshot& view, const MapQuery& query,
                                     const std::optional<Continuation>& token) {
  if (!token) {
    return Refusal{QueryStatus::invalid_request,
                   "continuation is damaged; hand back the text of the last page as it is"};
  }
  if (token->map_id != view.map_id || token->map_version != view.version) {
    std::ostringstream reason;
    reason << "continuation is of map " << token->map_id << " version " << token->map_version
           << ", the map is now " << view.map_id << " version " << view.version
           << "; ask again without continuation";
    return Refusal{QueryStatus::stale_continuation, reason.str()};
  }
  if (token->query_fingerprint != fingerprint(query)) {
    return Refusal{QueryStatus::invalid_request,
                   "continuation is of another query; keep region, classes, resolution_m and "
                   "since_version as they were on the first page"};
  }
  return std::nullopt;
}

std::uint64_t fingerprint(const MapQuery& query) {
  QueryWords words;
  words.add(static_cast<std::uint64_t>(query.region.index()));
  std::visit([&](const auto& kind) { words.add(kind); }, query.region);
  words.add(std::uint64_t{query.classes.to_ullong()});
  words.add(query.resolution_m);
  words.add(std::uint64_t{query.since ? 1U : 0U});
  words.add(query.since.value_or(KnownVersion()).map_id);
  words.add(query.since.value_or(KnownVersion()).version);
  return words.hash();
}

}  // namespace stillmap
