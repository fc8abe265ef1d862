#pragma once

#include <compare>
#include <cstddef>
#include <iterator>
#include <type_traits>
#include <utility>

namespace stillmap {

/// Random access to a container by its `operator[]`, which may give elements by value; the
/// container must outlive it.
template <typename Container>
class IndexedIterator {
 public:
  using reference = decltype(std::declval<const Container&>()[0]);
  using value_type = std::remove_cvref_t<reference>;
  using difference_type = std::ptrdiff_t;
  using iterator_concept = std::random_access_iterator_tag;
  /// Before C++20 no iterator of random access gave values.
  using iterator_category =
      std::conditional_t<std::is_reference_v<reference>, std::random_access_iterator_tag,
                         std::input_iterator_tag>;
  /// Holds the element that is pointed to, where that is a value.
  struct Held {
    value_type element;
    const value_type* operator->() const { return &element; }
  };
  using pointer = std::conditional_t<std::is_reference_v<reference>, const value_type*, Held>;

  IndexedIterator() = default;
  IndexedIterator(const Container* container, std::size_t position)
      : container_(container), position_(static_cast<difference_type>(position)) {}

  [[nodiscard]] reference operator*() const { return (*this)[0]; }
  [[nodiscard]] reference operator[](difference_type n) const {
    return (*container_)[static_cast<std::size_t>(position_ + n)];
  }
  [[nodiscard]] pointer operator->() const {
    if constexpr (std::is_reference_v<reference>)
      return &**this;
    else
      return {**this};
  }
  IndexedIterator& operator+=(difference_type n) {
    position_ += n;
    return *this;
  }
  IndexedIterator& operator-=(difference_type n) { return *this += -n; }
  IndexedIterator& operator++() { return *this += 1; }
  IndexedIterator& operator--() { return *this -= 1; }
  IndexedIterator operator++(int) { return std::exchange(*this, *this + 1); }
  IndexedIterator operator--(int) { return std::exchange(*this, *this - 1); }
  friend IndexedIterator operator+(IndexedIterator at, difference_type n) { return at += n; }
  friend IndexedIterator operator+(difference_type n, IndexedIterator at) { return at += n; }
  friend IndexedIterator operator-(IndexedIterator at, difference_type n) { return at -= n; }
  friend difference_type operator-(const IndexedIterator& a, const IndexedIterator& b) {
    return a.position_ - b.position_;
  }
  friend bool operator==(const IndexedIterator& a, const IndexedIterator& b) {
    return a.position_ == b.position_;
  }
  friend auto operator<=>(const IndexedIterator& a, const IndexedIterator& b) {
    return a.position_ <=> b.position_;
  }

 private:
  const Container* container_ = nullptr;
  difference_type position_ = 0;
};

}  // namespace stillmap
