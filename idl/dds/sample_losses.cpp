#include "idl/dds/sample_losses.hpp"

#include <algorithm>

namespace stillmap::dds {
namespace {

// Writers that come and go, as restarted drivers do, must not fill the memory.
constexpr std::size_t max_writers = 64;

}  // namespace

std::uint64_t SampleLosses::add(const eprosima::fastrtps::rtps::SampleIdentity& sample) {
  const auto number = static_cast<std::uint64_t>(sample.sequence_number().to64long());
  const auto [known, is_new] = writers_.try_emplace(sample.writer_guid());
  OfWriter& writer = known->second;
  heard_[sample.writer_guid()] = ++added_;
  ++writer.received;
  std::uint64_t missing = 0;
  if (!is_new && number > writer.number + 1) missing = number - writer.number - 1;
  writer.number = std::max(writer.number, number);
  writer.lost += missing;
  lost_ += missing;
  if (writers_.size() > max_writers) forget_oldest();
  return missing;
}

void SampleLosses::forget_oldest() {
  using Heard = std::pair<const Guid, std::uint64_t>;
  const auto oldest = std::ranges::min_element(heard_, {}, &Heard::second);
  writers_.erase(oldest->first);
  heard_.erase(oldest);
}

}  // namespace stillmap::dds
