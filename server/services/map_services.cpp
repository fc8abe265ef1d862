#include "server/services/map_services.hpp"

#include <utility>

#include "server/services/check_path.hpp"
#include "server/services/get_map.hpp"
#include "server/services/get_status.hpp"
#include "server/services/get_tile_versions.hpp"
#include "server/services/get_tiles.hpp"
#include "server/services/get_traversable_area.hpp"
#include "server/services/load_map.hpp"
#include "server/services/nearest_traversable.hpp"
#include "server/services/reset.hpp"
#include "server/services/save_map.hpp"

namespace stillmap::server {

MapServices::MapServices(dds::Participant& participant, const dds::Services& names,
                         ServiceContext context)
    : context_(std::move(context)),
      static_map_(context_),
      get_static_map_(participant, names.get_static_map,
                      logged(context_.log, names.get_static_map,
                             [this](const auto& request) { return static_map_(request); }),
                      [this] { static_map_.drop_expired(); }),
      get_tile_versions_(
          participant, names.get_tile_versions,
          logged(context_.log, names.get_tile_versions,
                 [this](const auto& request) { return get_tile_versions(context_, request); })),
      get_tiles_(participant, names.get_tiles,
                 logged(context_.log, names.get_tiles,
                        [this](const auto& request) { return get_tiles(context_, request); })),
      get_status_(participant, names.get_status,
                  logged(context_.log, names.get_status,
                         [this](const auto& request) { return get_status(context_, request); })),
      save_map_(participant, names.save_map,
                logged(context_.log, names.save_map,
                       [this](const auto& request) { return save_map(context_, request); })),
      load_map_(participant, names.load_map,
                logged(context_.log, names.load_map,
                       [this](const auto& request) { return load_map(context_, request); })),
      reset_(participant, names.reset,
             logged(context_.log, names.reset,
                    [this](const auto& request) { return server::reset(context_, request); })),
      get_traversable_area_(
          participant, names.get_traversable_area,
          logged(context_.log, names.get_traversable_area,
                 [this](const auto& request) { return get_traversable_area(context_, request); })),
      check_path_(participant, names.check_path,
                  logged(context_.log, names.check_path,
                         [this](const auto& request) { return check_path(context_, request); })),
      nearest_traversable_(
          participant, names.nearest_traversable,
          logged(context_.log, names.nearest_traversable,
                 [this](const auto& request) { return nearest_traversable(context_, request); })),
      get_map_(participant, names.get_map, logged(context_.log, names.get_map, [this](const auto&) {
                 return get_map(context_);
               })) {}

}  // namespace stillmap::server
