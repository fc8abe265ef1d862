#include "idl/dds/secured_participant.hpp"

#include <dlfcn.h>

#include <array>
#include <functional>
#include <mutex>
#include <string>

#include "idl/dds/security/identity.hpp"

// Fast DDS 2.9 exports this function, but installs no header that declares it.
namespace eprosima::fastrtps::rtps {

class ParticipantProxyData;

namespace security {

// Seen by the library also where a build hides what a program does not export.
class __attribute__((visibility("default"))) SecurityManager {
  void match_builtin_endpoints(const ParticipantProxyData& peer);
};

/// Called by Fast DDS instead of its own function of this name, which it stands before, as each
/// program's functions do before those of its libraries.
///
/// By this, a secured participant begins to hear a peer that it has just discovered, and to send to
/// it, of which authentication is the first. Fast DDS 2.9.1 writes down meanwhile, in members that
/// no lock guards, whom it is about. A participant receives in several threads, one for multicast
/// and one for unicast say, and in a domain of several others two of them discover two peers at the
/// same time: one of the peers gets the name or the addresses of the other, or none, its handshake
/// never ends, and neither side hears the other as long as both live. (Mended in Fast DDS 2.6.5,
/// 2.8.2, 2.9.2 and 2.10: its pull request 3362.) So only one thread at a time gets in. Weak: where
/// Fast DDS is linked into the program, its own is taken.
__attribute__((weak)) void SecurityManager::match_builtin_endpoints(
    const ParticipantProxyData& peer) {
  using OfFastDds = void (*)(SecurityManager*, const ParticipantProxyData&);
  static const auto of_fast_dds = reinterpret_cast<OfFastDds>(
      ::dlsym(RTLD_NEXT,
              "_ZN8eprosima8fastrtps4rtps8security15SecurityManager23match_builtin_endpointsERKNS1_"
              "20ParticipantProxyDataE"));
  // Each participant has a manager of its own: one that is held up shall hold up few others.
  // Nothing is sent meanwhile, and no callback of ours is called.
  static std::array<std::mutex, 64> one_at_a_time;
  const std::size_t turn = std::hash<SecurityManager*>{}(this) / 64 % one_at_a_time.size();
  const std::scoped_lock lock(one_at_a_time[turn]);
  of_fast_dds(this, peer);
}

}  // namespace security
}  // namespace eprosima::fastrtps::rtps

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
