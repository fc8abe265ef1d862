#include "idl/conversions/localization.hpp"
#include "idl/conversions/status.hpp"
#include "server/services/service_handlers.hpp"

namespace stillmap::server {

using namespace stillmap_msgs::srv;

GetStatus_Response get_status(const ServiceContext& context, const GetStatus_Request& request) {
  using Response = GetStatus_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    response.server(wire::to_wire(context.status()));
  });
}

SaveMap_Response save_map(const ServiceContext& context, const SaveMap_Request& request) {
  using Response = SaveMap_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    context.publish_now();
    response.status(reply_status(*context.latest_map.view()));
    response.file(context.saver.save_as(request.file(), request.overwrite()).string());
  });
}

LoadMap_Response load_map(const ServiceContext& context, const LoadMap_Request& request) {
  using Response = LoadMap_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const auto file = context.saver.resume_from(request.file(), context.prepare_map);
    const auto view = context.latest_map.view();
    response.status(reply_status(*view));
    response.file(file.string());
    response.tile_count(view->tiles.size());
    response.pose_count(context.latest_map.trajectory().size());
  });
}

Localize_Response localize(const ServiceContext& context, const Localize_Request& request) {
  using Response = Localize_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    wire::write_answer(context.localize(wire::from_request(request)), response);
  });
}

Reset_Response reset(const ServiceContext& context, const Reset_Request& request) {
  using Response = Reset_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const NewMap begun = context.saver.begin_anew(request.discard(), context.begin_map);
    response.status(wire::to_reply_status(wire::ReplyCode::ok, {}, 0, begun.map_id));
    response.kept_file(begun.kept_file.string());
  });
}

}  // namespace stillmap::server
