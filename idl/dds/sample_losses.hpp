#pragma once

#include <fastdds/rtps/common/SampleIdentity.h>

#include <cstdint>
#include <map>

namespace stillmap::dds {

/// What a reader missed, by gaps in the numbers that each writer gives its samples: lost on the
/// way, replaced in a history before they were sent, or before they were taken. What comes before
/// the first sample of a writer is not counted.
class SampleLosses {
 public:
  using Guid = eprosima::fastrtps::rtps::GUID_t;

  struct OfWriter {
    std::uint64_t received = 0;
    std::uint64_t lost = 0;
    /// Of the newest sample.
    std::uint64_t number = 0;
  };

  /// Returns how many are missing directly before this sample.
  std::uint64_t add(const eprosima::fastrtps::rtps::SampleIdentity& sample);

  /// Of all writers, also those that are forgotten.
  [[nodiscard]] std::uint64_t lost() const { return lost_; }
  /// By writer; those that were silent longest are forgotten where there are many.
  [[nodiscard]] const std::map<Guid, OfWriter>& writers() const { return writers_; }

 private:
  void forget_oldest();

  std::map<Guid, OfWriter> writers_;
  /// When each writer was heard last, in samples added.
  std::map<Guid, std::uint64_t> heard_;
  std::uint64_t added_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace stillmap::dds
