#pragma once

#include <filesystem>

#include "idl/interface/roles.hpp"

namespace stillmap {

/// The names that an authority's permissions are made for, kept beside its key so that a later
/// identity fits the first ones. Throws SecurityError when the file cannot be written.
void keep_topic_names(const TopicNames& names, const std::filesystem::path& authority_folder);

/// Throws SecurityError for a file that is damaged or not there.
[[nodiscard]] TopicNames kept_topic_names(const std::filesystem::path& authority_folder);

}  // namespace stillmap
