#include "idl/dds/serialized_sample.hpp"

#include <algorithm>
#include <cassert>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <memory>
#include <utility>

#include "idl/dds/dds_error.hpp"

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::TypeSupport;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

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

class SerializedSampleType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  /// `keys`: the type itself, for the keys of its samples; empty when it has none.
  SerializedSampleType(const std::string& type_name, TypeSupport keys) : keys_(std::move(keys)) {
    setName(type_name.c_str());
    // Payloads grow as they need.
    constexpr std::uint32_t initial_bytes = 256;
    m_typeSize = initial_bytes;
    m_isGetKeyDefined = !keys_.empty() && keys_->m_isGetKeyDefined;
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

  /// Called only where a writer sends no hash of the key.
  bool getKey(void* data, InstanceHandle_t* handle, bool force_md5) override {
    if (!m_isGetKeyDefined) return false;
    BorrowedPayload payload(*static_cast<SerializedSample*>(data));
    void* const sample = keys_->createData();
    const bool known =
        keys_->deserialize(&payload, sample) && keys_->getKey(sample, handle, force_md5);
    keys_->deleteData(sample);
    return known;
  }

  [[nodiscard]] bool is_bounded() const override { return false; }

 private:
  TypeSupport keys_;
};

}  // namespace

TypeSupport serialized_sample_type(const std::string& type_name) {
  return TypeSupport(std::make_unique<SerializedSampleType>(type_name, TypeSupport()).release());
}

TypeSupport serialized_sample_type(const TypeSupport& type) {
  return TypeSupport(std::make_unique<SerializedSampleType>(type->getName(), type).release());
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
