#pragma once

#include <fastrtps/rtps/attributes/PropertyPolicy.h>

#include <filesystem>

namespace stillmap::dds {

/// Adds what switches DDS Security on with the identity in this folder.
void add_security(const std::filesystem::path& identity_folder,
                  eprosima::fastrtps::rtps::PropertyPolicy& properties);

}  // namespace stillmap::dds
