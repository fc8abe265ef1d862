#include "core/dataset/point_cloud_loaders.hpp"

#include <pcl/PCLPointCloud2.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <sstream>
#include <string>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/pcd_plugin.hpp"
#include "core/dataset/plugin.hpp"
#include "core/dataset/cloud_content.hpp"

namespace stillmap {
namespace {

using pcl::PCLPointField;

std::uint8_t datatype_of(const CloudField& field) {
  const bool is_signed = field.kind == 'I';
  if (field.kind == 'F') return field.bytes == 4 ? PCLPointField::FLOAT32 : PCLPointField::FLOAT64;
  if (field.bytes == 1) return is_signed ? PCLPointField::INT8 : PCLPointField::UINT8;
  if (field.bytes == 2) return is_signed ? PCLPointField::INT16 : PCLPointField::UINT16;
  return is_signed ? PCLPointField::INT32 : PCLPointField::UINT32;
}

/// The checked header in the form that PCL is known to read.
std::string clean_header(const CloudContent& content) {
  std::ostringstream names, sizes, types, counts, header;
  for (std::size_t i = 0; i < content.fields.size(); ++i) {
    const CloudField& field = content.fields[i];
    // PCL treats padding, "_", differently from one encoding to the other.
    names << ' ' << (field.name == "_" ? "padding" + std::to_string(i) : field.name);
    sizes << ' ' << field.bytes;
    types << ' ' << field.kind;
    counts << ' ' << field.count;
  }
  header << "VERSION 0.7\nFIELDS" << names.str() << "\nSIZE" << sizes.str() << "\nTYPE"
         << types.str() << "\nCOUNT" << counts.str() << "\nWIDTH " << content.width << "\nHEIGHT "
         << content.height << "\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << content.points() << "\nDATA "
         << content.encoding << '\n';
  return header.str();
}

template <class T>
void store(double value, std::uint8_t* to) {
  T stored{};
  if constexpr (std::is_floating_point_v<T>) {
    stored = static_cast<T>(value);
  } else if (value >= std::numeric_limits<T>::min() && value <= std::numeric_limits<T>::max()) {
    stored = static_cast<T>(value);
  }
  std::memcpy(to, &stored, sizeof stored);
}

void store_as(std::uint8_t datatype, double value, std::uint8_t* to) {
  switch (datatype) {
    case PCLPointField::INT8:
      return store<std::int8_t>(value, to);
    case PCLPointField::UINT8:
      return store<std::uint8_t>(value, to);
    case PCLPointField::INT16:
      return store<std::int16_t>(value, to);
    case PCLPointField::UINT16:
      return store<std::uint16_t>(value, to);
    case PCLPointField::INT32:
      return store<std::int32_t>(value, to);
    case PCLPointField::UINT32:
      return store<std::uint32_t>(value, to);
    case PCLPointField::FLOAT32:
      return store<float>(value, to);
    default:
      return store<double>(value, to);
  }
}

void fill_from_text(const std::filesystem::path& file, const CloudContent& content,
                    pcl::PCLPointCloud2& cloud) {
  std::istringstream body(content.body);
  std::string word;
  for (std::size_t i = 0; i < content.points(); ++i) {
    for (const PCLPointField& field : cloud.fields) {
      double value = 0.0;
      try {
        body >> word;
        // std::stod knows nan and inf, a stream does not.
        value = body ? std::stod(word) : throw std::invalid_argument("end of file");
      } catch (const std::exception&) {
        throw DatasetError(file, "point " + std::to_string(i) + " has no number for " +
                                     field.name.substr(0, 40) + "; the file is damaged");
      }
      store_as(field.datatype, value, cloud.data.data() + i * cloud.point_step + field.offset);
    }
  }
}

void swap_bytes(const CloudContent& content, pcl::PCLPointCloud2& cloud) {
  auto* bytes = cloud.data.data();
  for (std::size_t i = 0; i < content.points(); ++i) {
    for (const CloudField& field : content.fields) {
      std::reverse(bytes, bytes + field.bytes);
      bytes += field.bytes;
    }
  }
}

}  // namespace

pcl::PCLPointCloud2 load_pcd(const std::filesystem::path& file) {
  const CloudContent content = read_pcd_content(file);
  std::string fault = "PCL cannot read it";
  pcl::PCLPointCloud2 cloud;
  if (content.points() == 0) {
    for (const CloudField& field : content.fields) {
      cloud.fields.emplace_back();
      cloud.fields.back().name = field.name;
      cloud.fields.back().datatype = datatype_of(field);
    }
    cloud.point_step = static_cast<std::uint32_t>(content.point_bytes());
    return cloud;
  }
  auto* const read_with_pcl = plugin_function<ReadPcd>("pcd", read_pcd_name, "PCD files are read");
  try {
    if (read_with_pcl(clean_header(content), content.encoding, content.body, cloud) &&
        cloud.data.size() >= std::size_t{cloud.width} * cloud.height * cloud.point_step) {
      return cloud;
    }
  } catch (const std::exception& error) {
    fault += std::string(": ") + error.what();
  }
  throw DatasetError(file, fault + "; the file is damaged, copy it again or remove it");
}

pcl::PCLPointCloud2 load_ply(const std::filesystem::path& file) {
  const CloudContent content = read_ply_content(file);
  pcl::PCLPointCloud2 cloud;
  for (const CloudField& field : content.fields) {
    PCLPointField& added = cloud.fields.emplace_back();
    added.name = field.name;
    added.datatype = datatype_of(field);
    added.count = 1;
    added.offset = cloud.point_step;
    cloud.point_step += static_cast<std::uint32_t>(field.bytes);
  }
  cloud.width = static_cast<std::uint32_t>(content.width);
  cloud.height = 1;
  cloud.data.resize(content.points() * cloud.point_step);
  if (content.encoding == "ascii") {
    fill_from_text(file, content, cloud);
    return cloud;
  }
  if (!cloud.data.empty()) {
    std::memcpy(cloud.data.data(), content.body.data(), cloud.data.size());
  }
  if (content.encoding == "binary_big_endian") swap_bytes(content, cloud);
  return cloud;
}

}  // namespace stillmap
