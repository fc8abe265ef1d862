#include "clients/terminal/json.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

namespace stillmap::cli {

struct Json::Value {
  explicit Value(nlohmann::json from = nullptr) : json(std::move(from)) {}

  nlohmann::json json;
};

Json::Json() : value_(std::make_unique<Value>()) {}
Json::Json(std::string_view text) : value_(std::make_unique<Value>(text)) {}
Json::Json(Signed number) : value_(std::make_unique<Value>(number.value)) {}
Json::Json(Unsigned number) : value_(std::make_unique<Value>(number.value)) {}
Json::Json(Real number) : value_(std::make_unique<Value>(number.value)) {}
Json::Json(Truth truth) : value_(std::make_unique<Value>(truth.value)) {}

Json::Json(std::initializer_list<Json> values) : Json() {
  const bool are_pairs = std::ranges::all_of(values, [](const Json& value) {
    const nlohmann::json& json = value.value_->json;
    return json.is_array() && json.size() == 2 && json.front().is_string();
  });
  if (!are_pairs) {
    *this = array(values);
    return;
  }
  value_->json = nlohmann::json::object();
  for (const Json& pair : values) {
    nlohmann::json& json = pair.value_->json;
    value_->json.emplace(json.front().get_ref<std::string&>(), std::move(json.back()));
  }
}

Json::Json(const Json& other) : value_(std::make_unique<Value>(*other.value_)) {}
Json::Json(Json&& other) noexcept = default;
Json& Json::operator=(const Json& other) {
  *this = Json(other);
  return *this;
}
Json& Json::operator=(Json&& other) noexcept = default;
Json::~Json() = default;

Json Json::array(std::initializer_list<Json> values) {
  Json whole;
  whole.value_->json = nlohmann::json::array();
  for (const Json& value : values) whole.value_->json.push_back(std::move(value.value_->json));
  return whole;
}

Json Json::object() {
  Json whole;
  whole.value_->json = nlohmann::json::object();
  return whole;
}

void Json::set(std::string_view key, Json value) {
  value_->json[std::string(key)] = std::move(value.value_->json);
}

void Json::push_back(Json value) { value_->json.push_back(std::move(value.value_->json)); }

void Json::append(Json array) {
  for (nlohmann::json& value : array.value_->json) value_->json.push_back(std::move(value));
}

// File names and what damaged files hold may be anything: JSON is not to fail for them.
std::string Json::dump(int indent) const {
  return value_->json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace stillmap::cli
