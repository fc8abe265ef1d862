#include "server/monitoring/discovery_diagnostics.hpp"

#include <utility>

#include "idl/interface/participant_diagnostics.hpp"

namespace stillmap::server {
namespace {

// Of all pairs in the domain, those with an end of ours.
std::vector<dds::Mismatch> own_mismatches(const dds::RemoteParticipant& self,
                                          std::vector<dds::RemoteParticipant> peers) {
  peers.push_back(self);
  std::vector<dds::Mismatch> found = dds::mismatches(peers);
  std::erase_if(found, [&](const dds::Mismatch& mismatch) {
    return mismatch.writer_participant.guid != self.guid &&
           mismatch.reader_participant.guid != self.guid;
  });
  return found;
}

}  // namespace

DiscoveryDiagnostics::DiscoveryDiagnostics(const dds::Participant& participant,
                                           std::function<void(const dds::Diagnostic&)> first_seen)
    : participant_(participant), first_seen_(std::move(first_seen)) {}

std::vector<dds::Diagnostic> DiscoveryDiagnostics::diagnostics() {
  const std::scoped_lock lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (now - collected_ < std::chrono::seconds(1)) return last_;
  collected_ = now;
  last_ = collect();
  for (const dds::Diagnostic& diagnostic : last_) {
    if (seen_.insert(diagnostic.what + diagnostic.evidence).second) first_seen_(diagnostic);
  }
  return last_;
}

std::vector<dds::Diagnostic> DiscoveryDiagnostics::collect() const {
  const dds::RemoteParticipant self = participant_.self();
  const std::vector<dds::RemoteParticipant> peers = participant_.remote_participants();
  std::vector<dds::Diagnostic> all = dds::mismatch_diagnostics(own_mismatches(self, peers));
  for (dds::Diagnostic& diagnostic : dds::security_diagnostics(self, peers))
    all.push_back(std::move(diagnostic));
  return all;
}

}  // namespace stillmap::server
