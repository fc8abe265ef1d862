#pragma once

#include <fastdds/rtps/attributes/PropertyPolicy.h>

#include <filesystem>

namespace stillmap::dds {

/// Adds what switches DDS Security on with the identity in this folder. What a participant so made
/// would do wrong in finding others is mended in the source of this function.
void add_security(const std::filesystem::path& identity_folder,
                  eprosima::fastrtps::rtps::PropertyPolicy& properties);

}  // namespace stillmap::dds
