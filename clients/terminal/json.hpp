#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <ranges>
#include <string>
#include <string_view>
#include <type_traits>

namespace stillmap::cli {

// nlohmann/json is a large header whose templates take seconds to compile in every source that
// makes a value: behind this class they are compiled once.

/// A JSON value that is being built, written as {"key", value} pairs in braces or added piece by
/// piece. Braces around pairs that begin with a text are an object, all others an array.
class Json {
 public:
  /// null
  Json();
  // NOLINTBEGIN(google-explicit-constructor): as values are written in braces.
  Json(std::nullptr_t) : Json() {}
  Json(const char* text) : Json(std::string_view(text)) {}
  Json(const std::string& text) : Json(std::string_view(text)) {}
  Json(std::string_view text);
  template <typename T>
  requires std::is_arithmetic_v<T> Json(T number) : Json(kind_of(number)) {}
  Json(std::initializer_list<Json> values);
  /// An array, or an object of a map.
  template <std::ranges::input_range Values>
  requires(!std::convertible_to<const Values&, std::string_view>) Json(const Values& values)
      : Json(requires { typename Values::mapped_type; } ? object() : array()) {
    for (const auto& value : values) {
      if constexpr (requires { typename Values::mapped_type; }) {
        set(value.first, value.second);
      } else {
        push_back(value);
      }
    }
  }
  // NOLINTEND(google-explicit-constructor)
  Json(const Json& other);
  Json(Json&& other) noexcept;
  Json& operator=(const Json& other);
  Json& operator=(Json&& other) noexcept;
  ~Json();

  [[nodiscard]] static Json array(std::initializer_list<Json> values = {});
  [[nodiscard]] static Json object();

  /// Makes an object of null, an error of any other value that is none.
  void set(std::string_view key, Json value);
  /// Makes an array of null, an error of any other value that is none.
  void push_back(Json value);
  /// Adds the values of another array.
  void append(Json array);

  /// On one line, or with so many blanks per level.
  [[nodiscard]] std::string dump(int indent = -1) const;

 private:
  struct Value;
  struct Signed {
    std::int64_t value;
  };
  struct Unsigned {
    std::uint64_t value;
  };
  struct Real {
    double value;
  };
  struct Truth {
    bool value;
  };
  explicit Json(Signed number);
  explicit Json(Unsigned number);
  explicit Json(Real number);
  explicit Json(Truth truth);

  template <typename T>
  static auto kind_of(T number) {
    if constexpr (std::same_as<T, bool>) {
      return Truth{number};
    } else if constexpr (std::floating_point<T>) {
      return Real{number};
    } else if constexpr (std::signed_integral<T>) {
      return Signed{number};
    } else {
      return Unsigned{number};
    }
  }

  // Mutable: a list in braces gives its values up.
  mutable std::unique_ptr<Value> value_;
};

}  // namespace stillmap::cli
