#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "idl/dds/reader.hpp"
#include "idl/dds/writer.hpp"

namespace stillmap::dds {

/// A sample as it lies on the wire: `encapsulation_bytes`, then its fields in CDR, neither decoded
/// nor checked.
using SerializedSample = std::vector<std::uint8_t>;

inline constexpr std::size_t encapsulation_bytes = 4;

/// Carries samples of a type as bytes, under its name: for topics whose samples can be read only
/// once it is known who wrote them. The type has no keys.
[[nodiscard]] eprosima::fastdds::dds::TypeSupport serialized_sample_type(
    const std::string& type_name);
/// The same, with the keys of `type` where it has some.
[[nodiscard]] eprosima::fastdds::dds::TypeSupport serialized_sample_type(
    const eprosima::fastdds::dds::TypeSupport& type);

/// The sample with `gap_bytes` (a multiple of 8, so that nothing shifts) zeros between the
/// encapsulation and its fields. `type` must be the sample's.
[[nodiscard]] SerializedSample to_bytes(eprosima::fastdds::dds::TypeSupport type,
                                        const void* sample, std::size_t gap_bytes);

/// False when the bytes are no sample of this type. `bytes` may be anything; they are not changed.
[[nodiscard]] bool from_bytes(eprosima::fastdds::dds::TypeSupport type,
                              std::span<std::uint8_t> bytes, void* sample);

/// Writes samples that are bytes already. Thread-safe.
class SerializedSampleWriter : public UntypedWriter {
 public:
  SerializedSampleWriter(Participant& participant, const std::string& topic,
                         const std::string& type_name, const TopicQos& qos)
      : UntypedWriter(participant, topic, serialized_sample_type(type_name), qos) {}

  /// False when there was no room. `params` gets the sample's own identity.
  [[nodiscard]] bool write(const SerializedSample& sample,
                           eprosima::fastrtps::rtps::WriteParams& params) {
    return write_untyped(&sample, params);
  }
};

/// Takes samples as bytes. One thread takes.
class SerializedSampleReader : public UntypedReader {
 public:
  /// `type` is a type's name or its TypeSupport, as serialized_sample_type takes them.
  template <typename Type>
  SerializedSampleReader(Participant& participant, const std::string& topic, const Type& type,
                         const TopicQos& qos)
      : UntypedReader(participant, topic, serialized_sample_type(type), qos) {}

  /// As Reader::take.
  [[nodiscard]] bool take(SerializedSample& sample, eprosima::fastdds::dds::SampleInfo& info,
                          const std::stop_token& stop, std::chrono::milliseconds timeout) {
    return take_untyped(&sample, info, stop, timeout);
  }
};

}  // namespace stillmap::dds
