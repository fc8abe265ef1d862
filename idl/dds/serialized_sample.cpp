#include "idl/dds/serialized_sample.hpp"

#include <algorithm>
#include <cassert>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <memory>

#include "idl/dds/dds_error.hpp"

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::TypeSupport;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

class SerializedSampleType : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit SerializedSampleType(const std::string& type_name) {
    setName(type_name.c_str());
    // To begin with; payloads grow as they need.
    constexpr std::uint32_t usual_bytes = 256;
    m_typeSize = usual_bytes;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* sample, SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<const SerializedSample*>(sample);
    if (payload->max_size < bytes.size()) return false;
    std::ranges::copy(bytes, payload->data);
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = bytes.size() > 1 ? bytes[1] : CDR_LE;
    return true;
  }

  bool deserialize(SerializedPayload_t* payload, void* sample) override {
    static_cast<SerializedSample*>(sample)->assign(payload->data, payload->data + payload->length);
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* sample) override {
    const auto& bytes = *static_cast<const SerializedSample*>(sample);
    return [&bytes] { return static_cast<std::uint32_t>(bytes.size()); };
  }

  void* createData() override { return std::make_unique<SerializedSample>().release(); }

  void deleteData(void* sample) override {
    const std::unique_ptr<SerializedSample> owned(static_cast<SerializedSample*>(sample));
  }

  bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
  [[nodiscard]] bool is_bounded() const override { return false; }
};

/// A payload in memory that is not its own.
class BorrowedPayload : public SerializedPayload_t {
 public:
  explicit BorrowedPayload(std::span<std::uint8_t> memory) {
    data = memory.data();
    length = max_size = static_cast<std::uint32_t>(memory.size());
  }
  // Or it would be freed.
  ~BorrowedPayload() { data = nullptr; }
  BorrowedPayload(const BorrowedPayload&) = delete;
  BorrowedPayload& operator=(const BorrowedPayload&) = delete;
};

}  // namespace

TypeSupport serialized_sample_type(const std::string& type_name) {
  return TypeSupport(std::make_unique<SerializedSampleType>(type_name).release());
}

SerializedSample to_bytes(TypeSupport type, const void* sample, std::size_t gap_bytes) {
  assert(gap_bytes % 8 == 0);
  // Fast DDS only reads the sample, but says so nowhere.
  void* const mutable_sample = const_cast<void*>(sample);
  SerializedSample bytes(gap_bytes + type->getSerializedSizeProvider(mutable_sample)());
  BorrowedPayload payload(std::span<std::uint8_t>(bytes).subspan(gap_bytes));
  if (!type->serialize(mutable_sample, &payload)) {
    throw DdsError("a sample of " + type.get_type_name() + " cannot be put into bytes");
  }
  bytes.resize(gap_bytes + payload.length);
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(gap_bytes), encapsulation_bytes,
              bytes.begin());
  std::fill_n(bytes.begin() + encapsulation_bytes, gap_bytes, std::uint8_t{0});
  return bytes;
}

bool from_bytes(TypeSupport type, std::span<std::uint8_t> bytes, void* sample) {
  BorrowedPayload payload(bytes);
  return type->deserialize(&payload, sample);
}

}  // namespace stillmap::dds
