#include "idl/dds/type_hash.hpp"

#include <algorithm>
#include <array>

namespace stillmap::dds {
namespace {

struct TypeHash {
  std::string_view dds_type;
  std::string_view hash;
};

/// In the order of the names.
constexpr TypeHash type_hashes[] = {
#include "type_hash_table.inc"
};
static_assert(std::ranges::is_sorted(type_hashes, {}, &TypeHash::dds_type));

constexpr std::string_view key = "typehash=";
constexpr std::string_view version = "RIHS01_";
constexpr std::size_t hash_length = version.size() + 64;

bool is_hash(std::string_view text) {
  return text.size() == hash_length && text.starts_with(version) &&
         text.find_first_not_of("0123456789abcdef", version.size()) == std::string_view::npos;
}

}  // namespace

std::string_view type_hash(std::string_view dds_type) {
  const auto* const found =
      std::ranges::lower_bound(type_hashes, dds_type, {}, &TypeHash::dds_type);
  const bool is_known = found != std::end(type_hashes) && found->dds_type == dds_type;
  return is_known ? found->hash : std::string_view();
}

std::string type_hash_user_data(std::string_view dds_type) {
  const std::string_view hash = type_hash(dds_type);
  return hash.empty() ? std::string() : std::string(key).append(hash).append(";");
}

std::string type_hash_in(std::string_view user_data) {
  // Pairs "key=value;", of which others may come first.
  while (!user_data.empty()) {
    const std::string_view pair = user_data.substr(0, user_data.find(';'));
    if (pair.starts_with(key) && is_hash(pair.substr(key.size()))) {
      return std::string(pair.substr(key.size()));
    }
    user_data.remove_prefix(std::min(pair.size() + 1, user_data.size()));
  }
  return {};
}

}  // namespace stillmap::dds
