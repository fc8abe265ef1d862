#include "idl/dds/secure_properties.hpp"

#include <string>

#include "idl/dds/security/identity.hpp"

namespace stillmap::dds {

void add_security(const std::filesystem::path& identity_folder,
                  eprosima::fastrtps::rtps::PropertyPolicy& properties) {
  const IdentityFiles files(std::filesystem::absolute(identity_folder));
  const auto add = [&](const std::string& name, const std::string& value) {
    properties.properties().emplace_back(name, value);
  };
  const auto add_file = [&](const std::string& name, const std::filesystem::path& file) {
    add(name, "file://" + file.string());
  };
  const std::string authentication = "dds.sec.auth.builtin.PKI-DH.";
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  add("dds.sec.auth.plugin", "builtin.PKI-DH");
  add_file(authentication + "identity_ca", files.identity_authority);
  add_file(authentication + "identity_certificate", files.certificate);
  add_file(authentication + "private_key", files.key);
  add("dds.sec.access.plugin", "builtin.Access-Permissions");
  add_file(access + "permissions_ca", files.permissions_authority);
  add_file(access + "governance", files.governance);
  add_file(access + "permissions", files.permissions);
  add("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
}

}  // namespace stillmap::dds
