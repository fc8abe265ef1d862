#include "idl/dds/type_support.hpp"

#include <cxxabi.h>
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastrtps/types/TypeObjectFactory.h>
#include <fastrtps/utils/md5.h>

#include <algorithm>
#include <exception>
#include <utility>
#include <vector>

#include "rmw_dds_common_iron.h"
#include "tile_index.h"
#include "tile_indexTypeObject.h"

namespace stillmap::dds {
namespace {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
using eprosima::fastdds::dds::TypeSupport;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

constexpr std::uint32_t encapsulation_bytes = 4;
constexpr std::size_t instance_handle_bytes = 16;

void set_encapsulation(const Cdr& cdr, SerializedPayload_t& payload) {
  payload.encapsulation = cdr.endianness() == Cdr::BIG_ENDIANNESS ? CDR_BE : CDR_LE;
}

thread_local RefusedBytes* listening = nullptr;

/// Of bytes that are no sample: what their encapsulation says that they are, as RTPS 10.5 numbers
/// it.
std::string refusal_of(const SerializedPayload_t& payload) {
  if (payload.length < encapsulation_bytes) return "less than an encapsulation";
  const unsigned kind = payload.data[1];
  const std::string length = std::to_string(payload.length) + " bytes";
  if (payload.data[0] != 0 || kind > 0x0B) return length + " of an unknown encapsulation";
  if (kind >= 0x06) return length + " of XCDR2, and only classic CDR (XCDR1) is read";
  if (kind >= 0x02) return length + " of a parameter list, and only plain CDR is read";
  return length + " that are no sample of the topic's type";
}

FastBuffer buffer_of(SerializedPayload_t& payload, std::size_t bytes) {
  return {reinterpret_cast<char*>(payload.data), bytes};
}

}  // namespace

std::string wire_type_name(const std::type_info& type) {
  int fault = 0;
  const std::unique_ptr<char, decltype(&std::free)> name(
      abi::__cxa_demangle(type.name(), nullptr, nullptr, &fault), &std::free);
  std::string wire_name = name.get();
  wire_name.insert(wire_name.rfind("::") + 2, "dds_::");
  return wire_name + "_";
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

CdrTypeSupport::CdrTypeSupport(const std::string& name, std::size_t max_bytes, bool is_keyed,
                               std::size_t max_key_bytes)
    : max_key_bytes_(max_key_bytes) {
  setName(name.c_str());
  // Room for a submessage's alignment.
  max_bytes += Cdr::alignment(max_bytes, 4);
  m_typeSize = static_cast<std::uint32_t>(max_bytes) + encapsulation_bytes;
  m_isGetKeyDefined = is_keyed;
}

bool CdrTypeSupport::serialize(void* sample, SerializedPayload_t* payload) {
  FastBuffer buffer = buffer_of(*payload, payload->max_size);
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  set_encapsulation(cdr, *payload);
  cdr.serialize_encapsulation();
  try {
    write(sample, cdr);
  } catch (const eprosima::fastcdr::exception::NotEnoughMemoryException&) {
    return false;
  }
  payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
  return true;
}

bool CdrTypeSupport::deserialize(SerializedPayload_t* payload, void* sample) {
  try {
    FastBuffer buffer = buffer_of(*payload, payload->length);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    cdr.read_encapsulation();
    set_encapsulation(cdr, *payload);
    read(sample, cdr);
    return true;
  } catch (const std::exception&) {
    if (listening == nullptr) return false;
    listening->reason_ = refusal_of(*payload);
    return true;
  }
}

RefusedBytes::RefusedBytes() : outer_(std::exchange(listening, this)) {}

RefusedBytes::~RefusedBytes() { listening = outer_; }

std::function<std::uint32_t()> CdrTypeSupport::getSerializedSizeProvider(void* sample) {
  return [this, sample] {
    return static_cast<std::uint32_t>(cdr_bytes(sample)) + encapsulation_bytes;
  };
}

bool CdrTypeSupport::getKey(void* sample, InstanceHandle_t* handle, bool force_md5) {
  if (!m_isGetKeyDefined) return false;
  std::vector<unsigned char> key(std::max(max_key_bytes_, instance_handle_bytes));
  FastBuffer buffer(reinterpret_cast<char*>(key.data()), max_key_bytes_);
  Cdr cdr(buffer, Cdr::BIG_ENDIANNESS);
  write_key(sample, cdr);
  if (!force_md5 && max_key_bytes_ <= instance_handle_bytes) {
    std::copy_n(key.begin(), instance_handle_bytes, &handle->value[0]);
    return true;
  }
  MD5 hash;
  hash.init();
  hash.update(key.data(), static_cast<unsigned int>(cdr.getSerializedDataLength()));
  hash.finalize();
  std::copy_n(std::begin(hash.digest), instance_handle_bytes, &handle->value[0]);
  return true;
}

template <>
TypeSupport type_support<stillmap_msgs::msg::TileInfo>() {
  using stillmap_msgs::msg::TileInfo;
  TypeSupport type(std::make_unique<GeneratedTypeSupport<TileInfo>>().release());
  auto* const factory = eprosima::fastrtps::types::TypeObjectFactory::get_instance();
  for (const bool is_complete : {true, false}) {
    // Filters look for the name that the type has on the wire; generated code uses another one.
    factory->add_type_object(type.get_type_name(),
                             stillmap_msgs::msg::GetTileInfoIdentifier(is_complete),
                             stillmap_msgs::msg::GetTileInfoObject(is_complete));
  }
  // It is for this process only: in discovery, it would make other vendors compare types.
  type->auto_fill_type_object(false);
  type->auto_fill_type_information(false);
  return type;
}

template <>
TypeSupport type_support<rmw_dds_common_iron::msg::ParticipantEntitiesInfo>() {
  using Info = rmw_dds_common_iron::msg::ParticipantEntitiesInfo;
  constexpr const char* name = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
  return TypeSupport(std::make_unique<GeneratedTypeSupport<Info>>(name).release());
}

}  // namespace stillmap::dds
