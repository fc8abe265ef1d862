#include "clients/terminal/progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

constexpr std::chrono::milliseconds bar_period{100};
constexpr std::chrono::seconds line_period{5};
constexpr std::size_t bar_width = 24;

std::string bar(double share) {
  const auto filled = static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * bar_width);
  std::string text = "[";
  text.append(filled, '#').append(bar_width - filled, '.');
  return text + "]";
}

}  // namespace

Progress::Progress(std::string task, std::string what, std::uint64_t total)
    : task_(std::move(task)),
      what_(std::move(what)),
      total_(total),
      terminal_(isatty(STDERR_FILENO) == 1),
      started_(Clock::now()),
      drawn_(started_) {}

Progress::~Progress() {
  if (bar_shown_) std::fputc('\n', stderr);
}

void Progress::update(std::uint64_t done, const std::string& note) {
  const auto now = Clock::now();
  const bool last = total_ > 0 && done >= total_;
  if (terminal_) {
    if (now - drawn_ < bar_period && !last) return;
    const double share = total_ > 0 ? static_cast<double>(done) / static_cast<double>(total_) : 0.0;
    const std::string line = task_ + " " + (total_ > 0 ? bar(share) + " " : "") +
                             figures(done, now) + (note.empty() ? "" : "  " + note);
    // Back to the start of the line, and clear what a longer line left behind.
    std::fprintf(stderr, "\r%s\033[K", line.c_str());
    std::fflush(stderr);
    bar_shown_ = true;
  } else {
    if (now - drawn_ < line_period) return;
    std::fprintf(stderr, "%s: %s%s\n", task_.c_str(), figures(done, now).c_str(),
                 note.empty() ? "" : ("  " + note).c_str());
  }
  drawn_ = now;
}

void Progress::say(const std::string& line) {
  clear_bar();
  std::fprintf(stderr, "%s\n", line.c_str());
}

std::string Progress::figures(std::uint64_t done, Clock::time_point now) const {
  const double seconds = std::chrono::duration<double>(now - started_).count();
  const double rate = seconds > 0.0 ? static_cast<double>(done) / seconds : 0.0;
  std::string text = std::to_string(done);
  if (total_ > 0) text.append("/").append(std::to_string(total_));
  text.append(" ").append(what_).append("  ").append(fixed(rate, 1)).append("/s");
  if (total_ > done && rate > 0.0) {
    const double left_s = std::ceil(static_cast<double>(total_ - done) / rate);
    text.append("  ").append(fixed(left_s, 0)).append(" s left");
  }
  return text;
}

void Progress::clear_bar() {
  if (!bar_shown_) return;
  std::fputs("\r\033[K", stderr);
  bar_shown_ = false;
}

}  // namespace stillmap::cli
