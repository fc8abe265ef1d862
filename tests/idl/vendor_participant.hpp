#pragma once

#include <array>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <memory>
#include <optional>
#include <string>

#include "idl/dds/qos.hpp"
#include "idl/dds/serialized_sample.hpp"

namespace stillmap::dds {

/// RTPS vendor ids, with which every GUID of the vendor's begins.
using VendorId = std::array<std::uint8_t, 2>;
inline constexpr VendorId rti_connext{0x01, 0x01};
inline constexpr VendorId eclipse_cyclone{0x01, 0x10};

/// A process whose GUIDs look as another vendor's, and which sends and takes plain bytes.
class VendorParticipant {
 public:
  using Listener = eprosima::fastdds::dds::DomainParticipantListener;

  /// `listener` hears of the other participants, and must outlive this one.
  explicit VendorParticipant(const VendorId& vendor, Listener* listener = nullptr);
  ~VendorParticipant();
  VendorParticipant(const VendorParticipant&) = delete;
  VendorParticipant& operator=(const VendorParticipant&) = delete;

  using Writer = eprosima::fastdds::dds::DataWriter;
  using Reader = eprosima::fastdds::dds::DataReader;

  [[nodiscard]] Writer& make_writer(const std::string& topic, const std::string& type_name,
                                    const TopicQos& qos);
  [[nodiscard]] Reader& make_reader(const std::string& topic, const std::string& type_name,
                                    const TopicQos& qos);

 private:
  [[nodiscard]] eprosima::fastdds::dds::Topic* topic(const std::string& name,
                                                     const std::string& type_name);

  eprosima::fastdds::dds::DomainParticipant* participant_ = nullptr;
};

/// A client of one service that says byte by byte what it asks.
class ByteClient {
 public:
  /// `has_reply_reader` false: it asks and never listens.
  ByteClient(VendorParticipant& peer, const std::string& service, const std::string& type_stem,
             bool has_reply_reader = true);

  [[nodiscard]] bool wait_for_server() const;
  /// Returns the request's identity. `call_number`: of a client that names its calls.
  eprosima::fastrtps::rtps::SampleIdentity call(const SerializedSample& request,
                                                std::int64_t call_number = 0);

  struct Reply {
    SerializedSample bytes;
    eprosima::fastrtps::rtps::SampleIdentity answered;
  };
  /// The next reply to anybody.
  [[nodiscard]] std::optional<Reply> receive(std::chrono::milliseconds timeout);

 private:
  VendorParticipant::Writer* requests_;
  VendorParticipant::Reader* replies_ = nullptr;
};

}  // namespace stillmap::dds
