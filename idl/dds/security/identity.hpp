#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "idl/dds/security/certificate.hpp"
#include "idl/dds/security/documents.hpp"

namespace stillmap::dds {

/// Files of one identity, named as ROS 2 names those of an enclave.
struct IdentityFiles {
  explicit IdentityFiles(const std::filesystem::path& folder);

  std::filesystem::path identity_authority;
  std::filesystem::path permissions_authority;
  std::filesystem::path certificate;
  std::filesystem::path key;
  std::filesystem::path governance;
  std::filesystem::path permissions;
};

/// Who this process is in a secured domain, and what it may do there.
struct Identity {
  std::filesystem::path folder;
  std::string name;
  std::string role;
  Validity validity;
  Access access;
};

/// What is wrong with the files of an identity.
struct IdentityFaults {
  /// With one of these nobody would talk to us. Each names the file and the way out.
  std::vector<std::string> faults;
  /// It works, but should not stay so: keys that others can read, an end that is near.
  std::vector<std::string> warnings;
};

/// Looks at the files in a folder as they are at `now`. Fast DDS refuses bad files without a
/// reason; this is the reason.
[[nodiscard]] IdentityFaults check_identity(const std::filesystem::path& folder,
                                            std::chrono::sys_seconds now);

/// Throws SecurityError with every fault that check_identity() finds now.
[[nodiscard]] Identity load_identity(const std::filesystem::path& folder);

}  // namespace stillmap::dds
