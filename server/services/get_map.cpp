#include "server/services/get_map.hpp"

namespace stillmap {

nav_msgs::srv::GetMap_Response get_map(const ServiceContext& context) {
  nav_msgs::srv::GetMap_Response response;
  response.map(context.planning_grid.message(context.planning_grid.grid()));
  return response;
}

}  // namespace stillmap
