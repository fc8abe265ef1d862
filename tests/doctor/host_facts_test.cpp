#include "clients/doctor/host_facts.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include "clients/doctor/domain_scan.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::cli {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A machine's files, made up.
class HostFactsTest : public testing::Test {
 protected:
  HostFactsTest() {
    write("proc/sys/net/core/rmem_max", "212992\n");
    write("dev/shm/fastrtps_0123456789abcdef", "segment");
    write("dev/shm/fastrtps_0123456789abcdef_el", "");
    write("dev/shm/sem.other", "");
    write("sys/class/net/lo/flags", "0x9\n");
    write("sys/class/net/eth0/flags", "0x1003\n");
    write("sys/class/net/tun0/flags", "0x91\n");
    write("proc/net/udp",
          "  sl  local_address rem_address   st\n"
          "   1: 00000000:1CE8 00000000:0000 07\n"    // 7400: domain 0
          "   2: 00000000:23F0 00000000:0000 07\n"    // 9200: no discovery port
          "   3: 0100007F:4F4C 00000000:0000 07\n"    // 20300: none either
          "   4: 0100FFEF:1EDC 00000000:0000 07\n");  // 7900: a doctor listens
  }

  void write(const std::string& name, const std::string& text) const {
    (void)root_.file(name, text);
  }
  [[nodiscard]] HostFacts facts() const { return read_host_facts(root_.path()); }
  [[nodiscard]] bool exists(const std::string& name) const { return fs::exists(root_ / name); }

  ScratchFolder root_;
};

TEST_F(HostFactsTest, AreReadFromTheMachinesFiles) {
  const HostFacts host = facts();
  EXPECT_EQ(host.max_receive_buffer_bytes, 212992U);
  EXPECT_EQ(host.shared_memory_fault, "");
  ASSERT_EQ(host.interfaces.size(), 3U);
  EXPECT_EQ(host.interfaces[0].name, "eth0");
  EXPECT_TRUE(host.interfaces[0].is_up && host.interfaces[0].has_multicast);
  EXPECT_TRUE(host.interfaces[1].is_loopback);
  EXPECT_FALSE(host.interfaces[2].has_multicast);
  EXPECT_THAT(domains_with_ports(host.udp_ports), ElementsAre(0U));
}

TEST_F(HostFactsTest, OfAnEmptyFolderAreNothing) {
  const ScratchFolder empty;
  const HostFacts host = read_host_facts(empty.path());
  EXPECT_FALSE(host.max_receive_buffer_bytes);
  EXPECT_THAT(host.shared_memory_fault, HasSubstr("does not exist"));
  EXPECT_THAT(host.segments, IsEmpty());
  EXPECT_FALSE(host.has_multicast_route);
}

TEST_F(HostFactsTest, KnowAMulticastRoute) {
  constexpr const char* head = "Iface Destination Gateway Flags RefCnt Use Metric Mask MTU\n";
  write("proc/net/route", std::string(head) + "eth0 0000A8C0 00000000 0001 0 0 0 00FFFFFF 0\n");
  EXPECT_FALSE(facts().has_multicast_route);
  write("proc/net/route", std::string(head) + "eth0 000000E0 00000000 0001 0 0 0 000000F0 0\n");
  EXPECT_TRUE(facts().has_multicast_route);
  write("proc/net/route", std::string(head) + "eth0 00000000 0100A8C0 0003 0 0 0 00000000 0\n");
  EXPECT_TRUE(facts().has_multicast_route);
}

TEST_F(HostFactsTest, TellSegmentsOfTheDeadFromThoseOfTheLiving) {
  ASSERT_EQ(facts().segments.size(), 1U);
  EXPECT_TRUE(facts().segments[0].is_stale);
  const int lock = ::open((root_ / "dev/shm/fastrtps_0123456789abcdef_el").c_str(), O_RDONLY);
  ASSERT_EQ(::flock(lock, LOCK_EX | LOCK_NB), 0);
  EXPECT_FALSE(facts().segments[0].is_stale);
  EXPECT_EQ(dds::remove_stale_segments(root_ / "dev/shm", 0s), 0);
  EXPECT_TRUE(exists("dev/shm/fastrtps_0123456789abcdef"));
  ::close(lock);
  // It may be about to be locked.
  EXPECT_EQ(dds::remove_stale_segments(root_ / "dev/shm", 60s), 0);
  EXPECT_TRUE(exists("dev/shm/fastrtps_0123456789abcdef"));
  write("dev/shm/fastrtps_port7410", "");
  EXPECT_EQ(dds::remove_stale_segments(root_ / "dev/shm", 0s, dds::StaleSegments::without_ports),
            1);
  EXPECT_FALSE(exists("dev/shm/fastrtps_0123456789abcdef"));
  EXPECT_TRUE(exists("dev/shm/fastrtps_port7410"));
  EXPECT_EQ(dds::remove_stale_segments(root_ / "dev/shm", 0s), 1);
  EXPECT_FALSE(exists("dev/shm/fastrtps_port7410"));
  EXPECT_FALSE(exists("dev/shm/fastrtps_0123456789abcdef_el"));
  EXPECT_TRUE(exists("dev/shm/sem.other"));
}

TEST_F(HostFactsTest, LocksOfPortsAreNotTriedWhereThoseStay) {
  write("dev/shm/fastrtps_port7410", "");
  write("dev/shm/fastrtps_port7410_el", "");
  const int watch = ::inotify_init1(IN_NONBLOCK);
  ASSERT_GE(::inotify_add_watch(watch, (root_ / "dev/shm/fastrtps_port7410_el").c_str(), IN_OPEN),
            0);
  (void)dds::remove_stale_segments(root_ / "dev/shm", 0s, dds::StaleSegments::without_ports);
  inotify_event opened{};
  EXPECT_LT(::read(watch, &opened, sizeof opened), 0) << "who takes the port finds it taken";
  ::close(watch);
}

TEST_F(HostFactsTest, ALockThatIsAPipeHoldsNobodyUp) {
  const fs::path lock = root_ / "dev/shm/fastrtps_0123456789abcdef_el";
  fs::remove(lock);
  ASSERT_EQ(::mkfifo(lock.c_str(), 0600), 0);
  EXPECT_EQ(facts().segments.size(), 1U);
}

TEST_F(HostFactsTest, ASegmentFromBeforeTheClockWasSetBackIsAsNewAsCanBe) {
  const fs::path segment = root_ / "dev/shm/fastrtps_0123456789abcdef";
  fs::last_write_time(segment, fs::file_time_type::clock::now() + 1h);
  EXPECT_EQ(facts().segments[0].age, 0s);
  EXPECT_EQ(dds::remove_stale_segments(root_ / "dev/shm", 1s), 0);
  EXPECT_EQ(dds::remove_stale_segments(root_ / "dev/shm", 0s), 1);
}

TEST(DomainPortsTest, AreThoseOfDiscoveryOnly) {
  const std::vector<std::uint16_t> ports{7400, 7410, 7650, 19900, 65400, 65500, 53};
  EXPECT_THAT(domains_with_ports(ports), ElementsAre(0U, 1U, 50U, 232U));
}

}  // namespace
}  // namespace stillmap::cli
