// A number that says whether a token comes as text, or as words that get the checksum that fits;
// then the query that it continues.

#include <span>

#include "core/map/query/map_query.hpp"
#include "core/map/query/query_checks.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace continuation_inputs {
namespace {

const MapSnapshot& street_view() {
  static const MapSnapshot view = small_street().view;
  return view;
}

MapQuery next_query(ByteSource& source) {
  MapQuery query;
  const std::uint8_t kind = source.byte();
  if ((kind & 1U) != 0) query.resolution_m = 1.0;
  if ((kind & 2U) != 0) query.region = SphereRegion{Eigen::Vector3d::Zero(), 2.0};
  query.max_bytes = source.value<std::uint16_t>();
  return query;
}

/// A token with a sound checksum; numbers that are asked to be are those of the street's query.
Continuation next_continuation(ByteSource& source, const MapQuery& query) {
  MapQuery first = query;
  first.max_bytes = 25;
  const auto page = query_map(street_view(), first);
  Continuation token = from_token(page.continuation).value_or(Continuation{});
  const std::uint8_t changed = source.byte();
  if ((changed & 1U) != 0) token.map_id = source.value<std::uint64_t>();
  if ((changed & 2U) != 0) token.map_version = source.value<std::uint64_t>();
  if ((changed & 4U) != 0) token.query_fingerprint = source.value<std::uint64_t>();
  if ((changed & 8U) != 0) token.total_voxels = source.value<std::uint64_t>();
  if ((changed & 16U) != 0) token.tile = source.value<std::uint64_t>();
  if ((changed & 32U) != 0) token.voxel = source.value<std::uint64_t>();
  return token;
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const bool as_text = (source.byte() & 1U) != 0;
  MapQuery query = next_query(source);
  if (as_text) {
    query.continuation = text_of(source.rest());
    const auto token = from_token(query.continuation);
    require(!token || from_token(to_token(*token)) == token, "a token comes back from its text");
  } else {
    query.continuation = to_token(next_continuation(source, query));
  }
  static_cast<void>(continued_map(query.continuation));
  const MapQueryResult page = query_map(street_view(), query);
  require(page.status == QueryStatus::ok || !page.reason.empty(), "a refusal says why");
}

std::vector<Seed> seeds() {
  MapQuery query;
  query.max_bytes = 250;
  const std::string token = query_map(street_view(), query).continuation;
  const std::string page = std::string("\0\xfa\0", 3);
  std::string words = with_choice(0, page);
  words.push_back(48);
  append_value(words, std::uint64_t{1});
  append_value(words, std::uint64_t{3});
  return {{"text", with_choice(1, page + token)}, {"words", words}};
}

}  // namespace
}  // namespace continuation_inputs

const Target continuation_target{"continuation", continuation_inputs::run,
                                 continuation_inputs::seeds};

}  // namespace stillmap::fuzz
