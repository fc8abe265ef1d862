#include "tests/ros/cyclone_peer/endpoints.hpp"

namespace stillmap::peer {

using namespace std::chrono_literals;

std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)> make_qos(const Qos& qos) {
  std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)> made(dds_create_qos(), &dds_delete_qos);
  dds_qset_reliability(made.get(),
                       qos.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       DDS_SECS(60));
  dds_qset_durability(
      made.get(), qos.transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(made.get(), qos.keep_all ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST,
                   qos.depth);
  return made;
}

Participant::Participant(std::uint32_t domain_id)
    : entity_(checked(dds_create_participant(domain_id, nullptr, nullptr), "participant")) {}

dds_entity_t Participant::topic(const dds_topic_descriptor_t& type, const std::string& name) const {
  return checked(dds_create_topic(entity_, &type, name.c_str(), nullptr, nullptr), "topic " + name);
}

bool wait_until(const std::function<bool()>& condition, std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

}  // namespace stillmap::peer
