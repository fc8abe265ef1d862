#include "server/services/get_map.hpp"

namespace stillmap::server {

nav_msgs::srv::GetMap_Response get_map(const ServiceContext& context) {
  nav_msgs::srv::GetMap_Response response;
  response.map(context.grid_provider.message(context.grid_provider.grid()));
  return response;
}

}  // namespace stillmap::server
