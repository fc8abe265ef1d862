#pragma once

#include <filesystem>

namespace stillmap::fuzz {

/// Opens a map file and goes on with what is in it: maps into it, asks it, works its areas out.
/// What the file may do is to be refused with MapFileError, or not to fit the configuration.
void load_and_resume_map(const std::filesystem::path& file);

}  // namespace stillmap::fuzz
