#include "server/monitoring/shown_name.hpp"

#include "idl/dds/shown_text.hpp"

namespace stillmap::server {

std::string shown_name(std::string_view name) {
  constexpr std::size_t max_shown_bytes = 100;
  return dds::shown_text(name, max_shown_bytes);
}

}  // namespace stillmap::server
