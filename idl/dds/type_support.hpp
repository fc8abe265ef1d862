#pragma once

#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <memory>
#include <string>
#include <typeinfo>
#include <utility>

#include "idl/msg/wire_types.hpp"

namespace stillmap::dds {

/// The name that a generated type has on the wire, as ROS 2 makes it:
/// stillmap_msgs::msg::dds_::Status_ of stillmap_msgs::msg::Status.
[[nodiscard]] std::string wire_type_name(const std::type_info& type);

/// The name that ROS 2 has for a type: "nav_msgs/msg/Odometry" of nav_msgs::msg::dds_::Odometry_.
[[nodiscard]] std::string ros_type_name(const eprosima::fastdds::dds::TypeSupport& type);

/// Carries samples of a generated type, in CDR, as the code does that fastddsgen generates beside
/// the type; but bytes that are no sample of it (an unknown encapsulation, a boolean that is
/// neither 0 nor 1) are refused, whereas generated code throws, which Fast DDS does not catch:
/// anybody in the domain could end the program.
class CdrTypeSupport : public eprosima::fastdds::dds::TopicDataType {
 public:
  bool serialize(void* sample, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override;
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* sample) override;
  std::function<std::uint32_t()> getSerializedSizeProvider(void* sample) override;
  bool getKey(void* sample, eprosima::fastrtps::rtps::InstanceHandle_t* handle,
              bool force_md5) override;

 protected:
  /// Sizes are of the largest sample and its largest key, as generated types tell them.
  CdrTypeSupport(const std::string& name, std::size_t max_bytes, bool is_keyed,
                 std::size_t max_key_bytes);

 private:
  virtual void write(const void* sample, eprosima::fastcdr::Cdr& cdr) const = 0;
  virtual void read(void* sample, eprosima::fastcdr::Cdr& cdr) const = 0;
  virtual void write_key(const void* sample, eprosima::fastcdr::Cdr& cdr) const = 0;
  [[nodiscard]] virtual std::size_t cdr_bytes(const void* sample) const = 0;

  std::size_t max_key_bytes_;
};

/// While it lives, bytes that CdrTypeSupport refuses in this thread are told to it instead, and
/// what was made of them is no sample: Fast DDS leaves out what is refused without a word.
class RefusedBytes {
 public:
  RefusedBytes();
  ~RefusedBytes();
  RefusedBytes(const RefusedBytes&) = delete;
  RefusedBytes& operator=(const RefusedBytes&) = delete;

  /// Why bytes were refused since the last call, such as "XCDR2 ..."; empty: none were.
  [[nodiscard]] std::string take_reason() { return std::exchange(reason_, {}); }

 private:
  friend class CdrTypeSupport;

  std::string reason_;
  RefusedBytes* outer_;
};

/// CdrTypeSupport of the generated type T.
template <typename T>
class GeneratedTypeSupport final : public CdrTypeSupport {
 public:
  explicit GeneratedTypeSupport(const std::string& name = wire_type_name(typeid(T)))
      : CdrTypeSupport(name, T::getMaxCdrSerializedSize(), T::isKeyDefined(),
                       T::getKeyMaxCdrSerializedSize()) {}

  void* createData() override { return std::make_unique<T>().release(); }
  void deleteData(void* sample) override {
    const std::unique_ptr<T> owned(static_cast<T*>(sample));
  }

 private:
  void write(const void* sample, eprosima::fastcdr::Cdr& cdr) const override {
    static_cast<const T*>(sample)->serialize(cdr);
  }
  void read(void* sample, eprosima::fastcdr::Cdr& cdr) const override {
    static_cast<T*>(sample)->deserialize(cdr);
  }
  void write_key(const void* sample, eprosima::fastcdr::Cdr& cdr) const override {
    static_cast<const T*>(sample)->serializeKey(cdr);
  }
  [[nodiscard]] std::size_t cdr_bytes(const void* sample) const override {
    return T::getCdrSerializedSize(*static_cast<const T*>(sample));
  }
};

/// What Fast DDS needs to carry a generated type.
template <typename T>
[[nodiscard]] eprosima::fastdds::dds::TypeSupport type_support() {
  // TypeSupport takes ownership of the pointer.
  return eprosima::fastdds::dds::TypeSupport(std::make_unique<GeneratedTypeSupport<T>>().release());
}

/// Also makes the type's fields known in this process, for content filters: readers that filter
/// need it, and so do writers, who then do not even send what a reader does not want.
template <>
[[nodiscard]] eprosima::fastdds::dds::TypeSupport type_support<stillmap_msgs::msg::TileInfo>();

/// Two layouts of one ROS 2 type: on the wire both have the name of the other one.
template <>
[[nodiscard]] eprosima::fastdds::dds::TypeSupport
type_support<rmw_dds_common_iron::msg::ParticipantEntitiesInfo>();

}  // namespace stillmap::dds
