#pragma once

#include <filesystem>

#include "idl/interface/roles.hpp"

namespace stillmap::cli {

/// The names that an authority's permissions are made for, kept beside its key so that a later
/// identity fits the first ones. Throws SecurityError when the file cannot be written.
void save_topic_names(const dds::TopicNames& names, const std::filesystem::path& authority_folder);

/// Throws SecurityError for a file that is damaged or not there.
[[nodiscard]] dds::TopicNames load_topic_names(const std::filesystem::path& authority_folder);

}  // namespace stillmap::cli
