#pragma once

#include <memory>
#include <utility>

namespace stillmap {

/// Keeps a subscription alive. Ends it when destroyed, after a running callback returned; must not
/// be destroyed from inside its own callback.
class Subscription {
 public:
  /// What a subscription holds: a reader and the thread that waits on it.
  class Receiver {
   public:
    virtual ~Receiver() = default;
  };

  Subscription() = default;
  explicit Subscription(std::unique_ptr<Receiver> receiver) : receiver_(std::move(receiver)) {}

  /// Ends it early.
  void end() { receiver_.reset(); }

 private:
  std::unique_ptr<Receiver> receiver_;
};

}  // namespace stillmap
