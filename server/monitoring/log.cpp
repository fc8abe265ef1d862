#include "server/monitoring/log.hpp"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/ansicolor_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <string>

namespace stillmap::server {
namespace {

/// Between two lines of one kind.
constexpr std::chrono::seconds min_interval{5};

spdlog::level::level_enum spdlog_level(LogLevel level) {
  switch (level) {
    case LogLevel::debug:
      return spdlog::level::debug;
    case LogLevel::info:
      return spdlog::level::info;
    case LogLevel::warning:
      return spdlog::level::warn;
    case LogLevel::error:
      return spdlog::level::err;
  }
  return spdlog::level::info;
}

/// "<4>" and the like, at the start of a line.
class JournalPriority : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm& /*time*/,
              spdlog::memory_buf_t& line) override {
    line.push_back('<');
    line.push_back(priority(message.level));
    line.push_back('>');
  }
  [[nodiscard]] std::unique_ptr<spdlog::custom_flag_formatter> clone() const override {
    return std::make_unique<JournalPriority>();
  }

 private:
  /// As syslog numbers them.
  static char priority(spdlog::level::level_enum level) {
    switch (level) {
      case spdlog::level::critical:
        return '2';
      case spdlog::level::err:
        return '3';
      case spdlog::level::warn:
        return '4';
      case spdlog::level::info:
        return '6';
      default:
        return '7';
    }
  }
};

/// Whether stderr goes to systemd's journal: JOURNAL_STREAM names its device and inode.
bool stderr_is_journal() {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat is {};
  if (stream == nullptr || fstat(STDERR_FILENO, &is) != 0) return false;
  return std::to_string(is.st_dev) + ":" + std::to_string(is.st_ino) == stream;
}

std::unique_ptr<spdlog::formatter> journal_format() {
  auto format = std::make_unique<spdlog::pattern_formatter>();
  format->add_flag<JournalPriority>('*').set_pattern("%*%v");
  return format;
}

}  // namespace

void start_log(LogLevel level) {
  auto sink = std::make_shared<spdlog::sinks::ansicolor_stderr_sink_mt>();
  auto logger = std::make_shared<spdlog::logger>("stillmap", std::move(sink));
  if (stderr_is_journal()) {
    logger->set_formatter(journal_format());
  } else {
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  }
  // A container's log has to have the last line before a crash.
  logger->flush_on(spdlog::level::debug);
  spdlog::set_default_logger(std::move(logger));
  set_log_level(level);
}

void set_log_level(LogLevel level) { spdlog::set_level(spdlog_level(level)); }

std::string ThrottledLog::due(const std::string& kind, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  const auto [known, is_new] = kinds_.try_emplace(kind, Kind{.last = now});
  if (!is_new && now - known->second.last < min_interval) {
    ++known->second.suppressed;
    return {};
  }
  const std::uint64_t suppressed = known->second.suppressed;
  known->second = {.last = now};
  if (suppressed == 0) return text;
  return text + " (and " + std::to_string(suppressed) + " more of this kind)";
}

void ThrottledLog::warn(const std::string& kind, const std::string& text) {
  if (const std::string line = due(kind, text); !line.empty()) spdlog::warn("{}", line);
}

void ThrottledLog::error(const std::string& kind, const std::string& text) {
  if (const std::string line = due(kind, text); !line.empty()) spdlog::error("{}", line);
}

bool NewLines::add(const std::string& text) {
  if (std::ranges::find(lines_, text) != lines_.end()) return false;
  lines_.push_back(text);
  if (lines_.size() > max_lines) lines_.pop_front();
  return true;
}

}  // namespace stillmap::server
