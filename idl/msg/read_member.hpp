#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/exceptions/NotEnoughMemoryException.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace stillmap::wire {

/// Reads a member of a generated type, as `cdr >> member` does in the code that fastddsgen writes.
/// Throws Fast CDR's exceptions.
template <typename T>
void read_member(eprosima::fastcdr::Cdr& cdr, T& member) {
  cdr >> member;
}

/// Reads a sequence. Fast CDR makes room for as many elements as it says to have, up to one for
/// each byte that is left: 8 MB would take gigabytes. This takes a few times the bytes that are
/// there: numbers have to be there before there is room for them, and objects are made as they are
/// read.
template <typename T>
void read_member(eprosima::fastcdr::Cdr& cdr, std::vector<T>& sequence) {
  auto begin = cdr.getState();
  std::uint32_t count = 0;
  cdr >> count;
  if constexpr (std::is_arithmetic_v<T>) {
    if (!cdr.jump(std::size_t{count} * sizeof(T))) {
      using eprosima::fastcdr::exception::NotEnoughMemoryException;
      throw NotEnoughMemoryException(NotEnoughMemoryException::NOT_ENOUGH_MEMORY_MESSAGE_DEFAULT);
    }
    cdr.setState(begin);
    cdr >> sequence;
  } else {
    sequence.resize(std::min<std::size_t>(sequence.size(), count));
    for (std::uint32_t i = 0; i < count; ++i) {
      if (i == sequence.size()) sequence.emplace_back();
      cdr >> sequence[i];
    }
  }
}

}  // namespace stillmap::wire
