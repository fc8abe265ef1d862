#include "clients/gateway/web_site.hpp"

#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

namespace stillmap::gateway {
namespace {

namespace http = boost::beast::http;

constexpr std::string_view tiles_path = "/tiles/";

std::string_view view(boost::beast::string_view text) { return {text.data(), text.size()}; }

/// Pages of others cannot frame ours, and no file is taken for what it is not.
void set_common(HttpResponse& response) {
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Content-Security-Policy",
               "default-src 'self'; connect-src *; img-src 'self' data: blob:; style-src 'self' "
               "'unsafe-inline'; frame-ancestors 'self'");
}

HttpResponse response_to(const HttpRequest& request, http::status status) {
  HttpResponse response(status, request.version());
  response.keep_alive(request.keep_alive());
  set_common(response);
  return response;
}

struct TileAddress {
  TileId id;
  std::uint64_t content_hash = 0;
};

template <typename T>
bool take_number(std::string_view& text, T& value, int base) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{}) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

bool take_slash(std::string_view& text) {
  if (!text.starts_with('/')) return false;
  text.remove_prefix(1);
  return true;
}

/// Of /tiles/X/Y/HASH, the hash in hexadecimal digits.
std::optional<TileAddress> tile_address(std::string_view path) {
  path.remove_prefix(tiles_path.size());
  TileAddress address;
  const bool is_one = take_number(path, address.id.x, 10) && take_slash(path) &&
                      take_number(path, address.id.y, 10) && take_slash(path) &&
                      take_number(path, address.content_hash, 16) && path.empty();
  return is_one ? std::optional(address) : std::nullopt;
}

HttpResponse file_response(const HttpRequest& request, const StaticFile& file) {
  const bool is_known = view(request[http::field::if_none_match]) == file.etag;
  HttpResponse response =
      response_to(request, is_known ? http::status::not_modified : http::status::ok);
  response.set(http::field::content_type, file.content_type);
  response.set(http::field::etag, file.etag);
  response.set(http::field::cache_control,
               file.is_immutable ? "private, max-age=31536000, immutable" : "no-cache");
  if (!is_known) response.body() = file.body;
  response.prepare_payload();
  return response;
}

HttpResponse tile_response(const HttpRequest& request, const EncodedTile& tile,
                           std::uint64_t wanted_hash) {
  HttpResponse response = response_to(request, http::status::ok);
  response.set(http::field::content_type, "application/octet-stream");
  // A tile that changed since comes as it is now, but not under the address of what it was.
  response.set(http::field::cache_control, tile.content_hash == wanted_hash
                                               ? "private, max-age=31536000, immutable"
                                               : "no-store");
  response.body() = tile.bytes;
  response.prepare_payload();
  return response;
}

}  // namespace

HttpResponse text_response(const HttpRequest& request, http::status status, std::string text) {
  HttpResponse response = response_to(request, status);
  response.set(http::field::content_type, "text/plain; charset=utf-8");
  response.body() = std::move(text);
  response.prepare_payload();
  return response;
}

void WebSite::answer(const HttpRequest& request, std::function<void(HttpResponse)> respond) const {
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    HttpResponse refusal =
        text_response(request, http::status::method_not_allowed, "GET is answered.\n");
    refusal.set(http::field::allow, "GET, HEAD");
    return respond(std::move(refusal));
  }
  const std::string_view path = path_of(view(request.target()));
  if (path.starts_with(tiles_path)) return answer_tile(request, std::move(respond));
  if (path == "/gateway.json") {
    HttpResponse state = text_response(request, http::status::ok, state_json_());
    state.set(http::field::content_type, "application/json");
    state.set(http::field::cache_control, "no-store");
    return respond(std::move(state));
  }
  if (const StaticFile* const file = files_.find(path)) {
    return respond(file_response(request, *file));
  }
  respond(text_response(request, http::status::not_found,
                        "Nothing is here: the page is at /, the Foxglove protocol at any path.\n"));
}

void WebSite::answer_tile(const HttpRequest& request,
                          std::function<void(HttpResponse)> respond) const {
  const auto address = tile_address(path_of(view(request.target())));
  if (!address) {
    return respond(text_response(request, http::status::bad_request,
                                 "Tiles are at /tiles/X/Y/HASH, as /tiles/-1/2/9f3c.\n"));
  }
  tiles_.get(address->id, address->content_hash,
             [request, respond = std::move(respond),
              hash = address->content_hash](const TileSource::Answer& answer) {
               if (answer.tile) return respond(tile_response(request, *answer.tile, hash));
               if (answer.fault.empty()) {
                 return respond(text_response(request, http::status::not_found,
                                              "The map has no such tile.\n"));
               }
               respond(text_response(request, http::status::bad_gateway, answer.fault + "\n"));
             });
}

}  // namespace stillmap::gateway
