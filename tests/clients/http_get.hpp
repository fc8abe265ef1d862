#pragma once

#include <string>

namespace stillmap::test {

/// A TCP port of 127.0.0.1, held until this goes.
class HeldPort {
 public:
  HeldPort();
  ~HeldPort();
  HeldPort(const HeldPort&) = delete;
  HeldPort& operator=(const HeldPort&) = delete;
  [[nodiscard]] int number() const { return number_; }

 private:
  int socket_ = -1;
  int number_ = 0;
};

/// Body of the answer to GET `path` from a server on this machine; empty when there is none or it
/// is not "200 OK".
[[nodiscard]] std::string http_get(int port, const std::string& path);

}  // namespace stillmap::test
