#include "server/monitoring/discovery_diagnostics.hpp"

#include <utility>

#include "idl/interface/participant_diagnostics.hpp"

namespace stillmap {
namespace {

// Of all pairs in the domain, those with an end of ours.
std::vector<Mismatch> own_mismatches(const Peer& self, std::vector<Peer> peers) {
  peers.push_back(self);
  std::vector<Mismatch> found = mismatches(peers);
  std::erase_if(found, [&](const Mismatch& mismatch) {
    return mismatch.writer_peer.guid != self.guid && mismatch.reader_peer.guid != self.guid;
  });
  return found;
}

}  // namespace

PeerReport::PeerReport(const Participant& participant,
                       std::function<void(const Finding&)> first_seen)
    : participant_(participant), first_seen_(std::move(first_seen)) {}

std::vector<Finding> PeerReport::findings() {
  const std::scoped_lock lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (now - looked_ < std::chrono::seconds(1)) return last_;
  looked_ = now;
  last_ = look();
  for (const Finding& finding : last_) {
    if (seen_.insert(finding.what + finding.evidence).second) first_seen_(finding);
  }
  return last_;
}

std::vector<Finding> PeerReport::look() const {
  const Peer self = participant_.self();
  const std::vector<Peer> peers = participant_.peers();
  std::vector<Finding> all = mismatch_findings(own_mismatches(self, peers));
  for (Finding& finding : security_findings(self, peers)) all.push_back(std::move(finding));
  return all;
}

}  // namespace stillmap
