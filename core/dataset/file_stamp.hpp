#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace stillmap {

/// Nanoseconds of a number of seconds in text ("1539765928.346003000", "1.037359e-01"). Plain
/// decimals are read exactly, which a double cannot do for times since 1970. Nothing when the text
/// is no such number or too large.
[[nodiscard]] std::optional<std::int64_t> ns_from_seconds(std::string_view text);

/// The stamp that a file's name without its ending carries: seconds with decimals
/// ("1539765928.346003000"), 13, 16 or 19 digits, which are milli-, micro- or nanoseconds since
/// 1970, or seconds and nanoseconds ("1583836591_182590976"); also behind a word and a "_"
/// ("cloud_1583836591_182590976"), as nuScenes has it
/// ("n015-...__LIDAR_TOP__1532402927647951.pcd"). Nothing for running numbers ("000012") and words.
[[nodiscard]] std::optional<std::int64_t> stamp_ns_from_name(std::string_view stem);

/// Whether a comes before b when numbers in names count as numbers: "2" before "10".
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b);

}  // namespace stillmap
