#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace stillmap {

static_assert(std::endian::native == std::endian::little,
              "fields are copied as they lie in memory");

/// Writes or reads the fields of one record in turn: one list of fields serves both ways.
class FieldWriter {
 public:
  explicit FieldWriter(std::uint8_t* to) : to_(to) {}
  template <typename Field>
  void operator()(const Field& field) {
    std::memcpy(to_, &field, sizeof(field));
    to_ += sizeof(field);
  }

 private:
  std::uint8_t* to_;
};

/// Reads fields one after the other, as the machine has them in memory. Checks no end: the caller
/// knows that they are there.
class FieldReader {
 public:
  explicit FieldReader(const std::uint8_t* from) : from_(from) {}
  template <typename Field>
  void operator()(Field& field) {
    std::memcpy(&field, from_, sizeof(field));
    from_ += sizeof(field);
  }

 private:
  const std::uint8_t* from_;
};

/// Reads the fields of `size` records at once: each field is an array, and its bytes lie in planes
/// of `size` bytes.
template <std::size_t size>
class BatchReader {
 public:
  using Plane = std::array<std::uint8_t, size>;
  explicit BatchReader(const Plane* planes) : plane_(planes) {}
  template <typename Number>
  void operator()(std::array<Number, size>& numbers) {
    for (std::size_t i = 0; i < size; ++i) {
      Number number = 0;
      for (std::size_t k = 0; k < sizeof(Number); ++k) {
        number = static_cast<Number>(number | static_cast<Number>(plane_[k][i]) << (8 * k));
      }
      numbers[i] = number;
    }
    plane_ += sizeof(Number);
  }

 private:
  const Plane* plane_;
};

/// Bytes that are of one kind from each of these ends to the next.
struct PlaneBytes {
  std::vector<std::uint8_t> bytes;
  /// Offsets, ascending.
  std::vector<std::size_t> plane_ends;
};

/// Appends the records by byte planes: the first byte of all, the second byte of all, and so on,
/// which compresses better than record after record. `visit(visitor, record)` lists the fields,
/// `record_bytes` of them.
template <std::size_t record_bytes, typename Record, typename Visit>
void append_planes(PlaneBytes& content, const std::vector<Record>& records, Visit visit) {
  const std::size_t count = records.size();
  const std::size_t begin = content.bytes.size();
  content.bytes.resize(begin + count * record_bytes);
  for (std::size_t k = 0; k <= record_bytes; ++k) content.plane_ends.push_back(begin + k * count);
  const std::span<std::uint8_t> planes = std::span(content.bytes).subspan(begin);
  std::array<std::uint8_t, record_bytes> record{};
  for (std::size_t i = 0; i < count; ++i) {
    visit(FieldWriter(record.data()), records[i]);
    for (std::size_t k = 0; k < record_bytes; ++k) planes[k * count + i] = record[k];
  }
}

/// Calls `use(batch, in_batch)` for `Batch::size` records of planes at a time, and for the rest. Of
/// a batch that is not full, what follows are records of zeros. `visit(visitor, batch)` lists the
/// fields as for single records.
template <std::size_t record_bytes, typename Batch, typename Visit, typename Use>
void for_each_batch_in_planes(const std::uint8_t* planes, std::size_t count, Visit visit, Use use) {
  std::array<typename BatchReader<Batch::size>::Plane, record_bytes> parts{};
  Batch batch;
  for (std::size_t begin = 0; begin < count; begin += Batch::size) {
    const std::size_t in_batch = std::min(Batch::size, count - begin);
    for (std::size_t k = 0; k < record_bytes; ++k) {
      std::memcpy(parts[k].data(), planes + k * count + begin, in_batch);
      std::fill(parts[k].begin() + static_cast<std::ptrdiff_t>(in_batch), parts[k].end(),
                std::uint8_t{0});
    }
    visit(BatchReader<Batch::size>(parts.data()), batch);
    use(batch, in_batch);
  }
}

/// Calls `use(record)` for each record of planes that begin at `planes`; there are enough bytes for
/// all.
template <std::size_t record_bytes, typename Record, typename Visit, typename Use>
void for_each_in_planes(const std::uint8_t* planes, std::size_t count, Visit visit, Use use) {
  // Plane by plane for so many records: the bytes of one lie far apart.
  constexpr std::size_t batch = 64;
  std::array<std::uint8_t, batch * record_bytes> records;
  for (std::size_t begin = 0; begin < count; begin += batch) {
    const std::size_t in_batch = std::min(batch, count - begin);
    for (std::size_t k = 0; k < record_bytes; ++k) {
      const std::uint8_t* const plane = planes + k * count + begin;
      for (std::size_t i = 0; i < in_batch; ++i) records[i * record_bytes + k] = plane[i];
    }
    for (std::size_t i = 0; i < in_batch; ++i) {
      Record record{};
      visit(FieldReader(&records[i * record_bytes]), record);
      use(record);
    }
  }
}

/// The same records in a list.
template <std::size_t record_bytes, typename Record, typename Visit>
std::vector<Record> read_planes(const std::uint8_t* planes, std::size_t count, Visit visit) {
  std::vector<Record> records;
  records.reserve(count);
  for_each_in_planes<record_bytes, Record>(planes, count, visit,
                                           [&](Record& record) { records.push_back(record); });
  return records;
}

}  // namespace stillmap
