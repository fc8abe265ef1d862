#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

#include "idl/dds/participant.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

/// What a process leaves in /dev/shm that was killed so long ago.
class LeftSegment {
 public:
  LeftSegment(const std::string& number, std::chrono::seconds age)
      : file_("/dev/shm/fastrtps_test" + std::to_string(::getpid()) + number),
        lock_(file_.string() + "_el") {
    std::ofstream(file_) << "samples";
    std::ofstream(lock_).flush();
    fs::last_write_time(file_, fs::file_time_type::clock::now() - age);
  }
  ~LeftSegment() {
    fs::remove(file_);
    fs::remove(lock_);
  }
  LeftSegment(const LeftSegment&) = delete;
  LeftSegment& operator=(const LeftSegment&) = delete;

  [[nodiscard]] bool is_there() const { return fs::exists(file_) && fs::exists(lock_); }
  [[nodiscard]] bool is_gone() const { return !fs::exists(file_) && !fs::exists(lock_); }
  [[nodiscard]] const fs::path& lock() const { return lock_; }

 private:
  fs::path file_;
  fs::path lock_;
};

TEST(StaleSegments, OfKilledProcessesGoWhenTheNextOneStarts) {
  const LeftSegment old("a", 1h), young("b", 0s), held("c", 1h);
  const int descriptor = ::open(held.lock().c_str(), O_RDONLY);
  ASSERT_EQ(::flock(descriptor, LOCK_EX | LOCK_NB), 0);
  const Participant participant(loopback(true));
  EXPECT_TRUE(old.is_gone());
  EXPECT_TRUE(young.is_there()) << "it may not be locked yet";
  EXPECT_TRUE(held.is_there()) << "its process lives";
  ::close(descriptor);
}

}  // namespace
}  // namespace stillmap::dds
