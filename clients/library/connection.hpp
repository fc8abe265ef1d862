#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/library/client.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap {

/// The client's participant and its service clients.
struct Client::Connection {
  explicit Connection(const ClientOptions& client_options);

  /// The server's reply; throws ServiceTimeout when there is none, whose text counts what was
  /// `waited` before, too.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply call(const dds::ServiceSpec<Request, Reply>& spec, Request request,
                           std::chrono::milliseconds timeout,
                           std::chrono::milliseconds waited = {}) {
    if constexpr (requires { request.format_version(dds::wire_format_version); }) {
      request.format_version(dds::wire_format_version);
    }
    auto& client = client_of(spec);
    if (!client.refusal().empty()) throw ServiceError(name_of(spec) + ": " + client.refusal());
    if (dds::asks_for_change(spec, request)) require_one_server(name_of(spec));
    const auto began = std::chrono::steady_clock::now();
    auto reply = client.call(request, timeout);
    if (!reply) {
      throw timeout_error(name_of(spec), timeout + waited,
                          {.found = client.wait_for_server(std::chrono::milliseconds(0)),
                           .modifies = spec.effect == dds::ServiceEffect::modifies,
                           .overdue = std::chrono::steady_clock::now() - began - timeout});
    }
    return *std::move(reply);
  }

  /// As above within the usual time.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply call(const dds::ServiceSpec<Request, Reply>& spec, Request request) {
    return call(spec, std::move(request), options.request_timeout);
  }

  /// As `call`; throws ServiceError when the server refuses. That it failed is an answer.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply call_unrefused(const dds::ServiceSpec<Request, Reply>& spec,
                                     Request request) {
    Reply reply = call(spec, std::move(request));
    const auto code = static_cast<wire::ReplyCode>(reply.status().code());
    if (code != wire::ReplyCode::ok && code != wire::ReplyCode::failed)
      throw refusal_of(spec, reply.status());
    return reply;
  }

  /// As `call`; throws ServiceError when the server refuses.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply call_ok(const dds::ServiceSpec<Request, Reply>& spec, Request request) {
    Reply reply = call(spec, std::move(request));
    if (reply.status().code() != static_cast<std::uint8_t>(wire::ReplyCode::ok)) {
      throw refusal_of(spec, reply.status());
    }
    return reply;
  }

  /// As `call`; throws ServiceError when the server failed. A refusal is an answer.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply call_unfailing(const dds::ServiceSpec<Request, Reply>& spec,
                                     Request request) {
    Reply reply = call(spec, std::move(request));
    if (reply.status().code() == static_cast<std::uint8_t>(wire::ReplyCode::failed)) {
      throw ServiceError(name_of(spec) + " failed: " + reply.status().reason(),
                         wire::ReplyCode::failed);
    }
    return reply;
  }

  template <typename Request, typename Reply>
  [[nodiscard]] dds::ServiceClient<Request, Reply>& client_of(
      const dds::ServiceSpec<Request, Reply>& spec) {
    return *static_cast<dds::ServiceClient<Request, Reply>*>(clients.at(spec.name).get());
  }

  /// "stillmap/get_status".
  template <typename Request, typename Reply>
  [[nodiscard]] std::string name_of(const dds::ServiceSpec<Request, Reply>& spec) const {
    return spec.in(options.server_name);
  }

  template <typename Request, typename Reply>
  [[nodiscard]] ServiceError refusal_of(const dds::ServiceSpec<Request, Reply>& spec,
                                        const stillmap_msgs::msg::ReplyStatus& status) const {
    return ServiceError(name_of(spec) + " was refused: " + status.reason(),
                        static_cast<wire::ReplyCode>(status.code()));
  }

  /// The value that a conversion read from a reply of this service; throws ServiceError where it
  /// read none.
  template <typename Value, typename Request, typename Reply>
  [[nodiscard]] Value require_readable(std::optional<Value> value,
                                       const dds::ServiceSpec<Request, Reply>& spec) const {
    if (!value) throw malformed_reply(name_of(spec));
    return *std::move(value);
  }

  /// These tiles with their voxels, in as many requests as the server's answers need.
  [[nodiscard]] TileSet fetch_tiles(std::span<const TileId> ids);
  /// Adds these tiles to the set, but for those that come back: the server could not read them.
  /// Nothing where a reply is of another map than the set.
  [[nodiscard]] std::optional<std::vector<TileId>> add_tiles(std::span<const TileId> ids,
                                                             TileSet& set);
  /// Asks once more for tiles that could not be read: some changed just then.
  [[nodiscard]] bool add_unread(std::span<const TileId> ids, TileSet& set);

  /// The tiles whose footprint meets the box (map frame [m]), all of one map.
  [[nodiscard]] TileVersions list_tiles(const Eigen::AlignedBox3d& box_map);

  /// Throws ServiceError that names them where several servers have this name and answer: a request
  /// that changes something would change all of their maps. Servers refuse it themselves where they
  /// see each other; a client may see those that do not, as by peers of its own.
  void require_one_server(const std::string& service);

  [[nodiscard]] static ServiceError malformed_reply(const std::string& service);
  /// What is known of a call without an answer.
  struct Unanswered {
    /// There is a server.
    bool found = false;
    /// The service changes something.
    bool modifies = false;
    /// How much later than it was to be this process noticed.
    std::chrono::duration<double> overdue{};
  };
  [[nodiscard]] ServiceTimeout timeout_error(const std::string& service,
                                             std::chrono::milliseconds timeout,
                                             const Unanswered& call) const;

  ClientOptions options;
  /// When its client began to wait for the server.
  std::chrono::steady_clock::time_point connecting_since = std::chrono::steady_clock::now();
  dds::Topics topics;
  dds::Participant participant;
  /// A dds::ServiceClient for each service of the table, by its name there.
  std::map<std::string_view, std::shared_ptr<void>> clients;
};

}  // namespace stillmap
