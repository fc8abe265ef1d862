#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <utility>

namespace stillmap::gateway {

/// At most so many connections at a time. Where all are taken, the oldest of those that have shown
/// least is closed, but for the newest one: whoever opens many without the token keeps nobody out
/// who has it. One thread uses it.
class ConnectionLimit : public std::enable_shared_from_this<ConnectionLimit> {
 public:
  enum class Standing {
    /// Has not asked for anything that it may have.
    unknown,
    /// Has asked for what it may have.
    allowed,
    /// A WebSocket. Is not closed for another one.
    session
  };

  /// One connection's, from its beginning to its end.
  class Lease {
   public:
    Lease(std::shared_ptr<ConnectionLimit> limit, std::list<Lease*>::iterator place)
        : limit_(std::move(limit)), place_(place) {}
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;

    void raise(Standing standing);
    /// `close` closes the connection; called at most once.
    void close_with(std::function<void()> close) { close_ = std::move(close); }

   private:
    friend class ConnectionLimit;

    std::shared_ptr<ConnectionLimit> limit_;
    /// Nothing once it is closed.
    std::optional<std::list<Lease*>::iterator> place_;
    Standing standing_ = Standing::unknown;
    std::function<void()> close_;
  };

  /// `freed` is called whenever a connection has ended by itself.
  ConnectionLimit(std::size_t max_connections, std::function<void()> freed)
      : max_connections_(max_connections), freed_(std::move(freed)) {}

  [[nodiscard]] std::shared_ptr<Lease> lend();
  [[nodiscard]] bool is_reached() const { return leases_.size() >= max_connections_; }
  /// Closes a connection, which counts no more; none where all but the newest are sessions.
  void close_one();
  /// `freed` is called no more.
  void end() { freed_ = nullptr; }

 private:
  std::size_t max_connections_;
  std::function<void()> freed_;
  /// Oldest first.
  std::list<Lease*> leases_;
};

}  // namespace stillmap::gateway
