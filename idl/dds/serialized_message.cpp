#include "idl/dds/serialized_message.hpp"

#include <algorithm>
#include <cstring>
#include <memory>
#include <utility>

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::TypeSupport;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

/// Keeps samples of another type as bytes.
class SerializedMessageType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit SerializedMessageType(TypeSupport type) : type_(std::move(type)) {
    m_typeSize = type_->m_typeSize;
    m_isGetKeyDefined = type_->m_isGetKeyDefined;
    setName(type_->getName());
  }

  bool serialize(void* data, SerializedPayload_t* payload) override {
    const auto& bytes = static_cast<SerializedMessage*>(data)->bytes;
    if (bytes.size() > payload->max_size) return false;
    std::ranges::copy(bytes, payload->data);
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = bytes.size() > 1 && bytes[1] == 0 ? CDR_BE : CDR_LE;
    return true;
  }

  bool deserialize(SerializedPayload_t* payload, void* data) override {
    static_cast<SerializedMessage*>(data)->bytes.assign(payload->data,
                                                        payload->data + payload->length);
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] {
      return static_cast<std::uint32_t>(static_cast<SerializedMessage*>(data)->bytes.size());
    };
  }

  void* createData() override { return std::make_unique<SerializedMessage>().release(); }
  void deleteData(void* data) override {
    const std::unique_ptr<SerializedMessage> gone(static_cast<SerializedMessage*>(data));
  }

  /// Only asked where a writer sends no hash of the key: the type itself knows the key then.
  bool getKey(void* data, InstanceHandle_t* handle, bool force_md5) override {
    auto& bytes = static_cast<SerializedMessage*>(data)->bytes;
    SerializedPayload_t payload;
    payload.data = bytes.data();
    payload.length = payload.max_size = static_cast<std::uint32_t>(bytes.size());
    void* sample = type_->createData();
    const bool known =
        type_->deserialize(&payload, sample) && type_->getKey(sample, handle, force_md5);
    type_->deleteData(sample);
    // The payload frees what it owns, and it owns nothing.
    payload.data = nullptr;
    return known;
  }

 private:
  TypeSupport type_;
};

}  // namespace

TypeSupport serialized_message_type(const TypeSupport& type) {
  return TypeSupport(std::make_unique<SerializedMessageType>(type).release());
}

std::string ros_type_name(const TypeSupport& type) {
  std::string name = type->getName();
  const auto replace = [&name](const std::string& what, const std::string& with) {
    for (auto at = name.find(what); at != std::string::npos; at = name.find(what, at)) {
      name.replace(at, what.size(), with);
    }
  };
  replace("::dds_::", "/");
  replace("::", "/");
  if (name.ends_with('_')) name.pop_back();
  return name;
}

}  // namespace stillmap::dds
