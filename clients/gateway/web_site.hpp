#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "clients/gateway/access_policy.hpp"
#include "clients/gateway/session.hpp"
#include "clients/gateway/static_files.hpp"
#include "clients/gateway/tile_source.hpp"

namespace stillmap::gateway {

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;
using HttpResponse = boost::beast::http::response<boost::beast::http::string_body>;

/// What is served over HTTP: the page, tiles for it, and what the gateway does. One thread uses it.
class WebSite {
 public:
  WebSite(StaticFiles files, TileSource& tiles, std::function<std::string()> state_json)
      : files_(std::move(files)), tiles_(tiles), state_json_(std::move(state_json)) {}

  /// `respond` is called once, later for tiles that must be fetched first.
  void answer(const HttpRequest& request, std::function<void(HttpResponse)> respond) const;

 private:
  void answer_tile(const HttpRequest& request, std::function<void(HttpResponse)> respond) const;

  StaticFiles files_;
  TileSource& tiles_;
  std::function<std::string()> state_json_;
};

/// A short answer in words.
[[nodiscard]] HttpResponse text_response(const HttpRequest& request,
                                         boost::beast::http::status status, std::string text);

}  // namespace stillmap::gateway
