#include "clients/library/discovery_server.hpp"

#include "idl/dds/participant.hpp"

namespace stillmap {

// A participant that serves discovery is all there is to it.
struct DiscoveryServer::Registry {
  explicit Registry(const dds::DdsOptions& options) : participant(options) {}

  dds::Participant participant;
};

DiscoveryServer::DiscoveryServer(const dds::DdsOptions& options)
    : registry_(std::make_unique<Registry>(options)) {}
DiscoveryServer::~DiscoveryServer() = default;

}  // namespace stillmap
