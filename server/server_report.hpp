#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "idl/server_status.hpp"
#include "server/map_board.hpp"
#include "server/statistics.hpp"

namespace stillmap {

/// Puts the server's status together, and says in words why nothing happens. Thread-safe.
class ServerReport {
 public:
  /// `lasting_trouble`: what is known to be wrong from the start, may be empty.
  /// `why_nothing_arrives` gives an empty text once scans arrive.
  ServerReport(DeliveryMode delivery, std::string label_source, std::string lasting_trouble,
               const MapBoard& board, const Statistics& statistics,
               std::function<std::string()> why_nothing_arrives);

  [[nodiscard]] ServerStatus status() const;

 private:
  [[nodiscard]] std::string reason(const ServerStatus& status) const;

  DeliveryMode delivery_;
  std::string label_source_;
  std::string lasting_trouble_;
  const MapBoard& board_;
  const Statistics& statistics_;
  std::function<std::string()> why_nothing_arrives_;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
};

}  // namespace stillmap
