#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstddef>
#include <fstream>
#include <semaphore>

#include "idl/dds/service_client.hpp"
#include "idl/dds/service_server.hpp"
#include "stillmap_msgs.h"
#include "tests/idl/dds_fixture.hpp"

// A client that asks and is stopped, as by SIGSTOP: it takes no reply and is still in the domain.

// GCC brings no header for it.
extern "C" std::size_t
__sanitizer_get_current_allocated_bytes();  // NOLINT(bugprone-reserved-identifier)

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using stillmap_msgs::srv::SaveMap_Request;
using stillmap_msgs::srv::SaveMap_Response;

constexpr auto large_service = "stillmap/save_map";
constexpr int stopped_requests = 90;
/// Of these; for the others there is room, or their replies are dropped later.
constexpr int min_refused = 40;
constexpr std::size_t large_reply_bytes = 4'000'000;

/// Asks so many times, takes the first reply, stops itself, and counts replies when it goes on.
class StoppingClient {
 public:
  using Count = int(SerializedSampleReader&);

  StoppingClient(std::uint32_t domain_id, int requests, Count* count)
      : pid_(::fork()), is_child_(pid_ == 0), domain_id_(domain_id), requests_(requests) {
    if (is_child_) ::_exit(run(count));
  }
  ~StoppingClient() { ::kill(pid_, SIGKILL); }
  StoppingClient(const StoppingClient&) = delete;
  StoppingClient& operator=(const StoppingClient&) = delete;

  [[nodiscard]] bool wait_until_stopped() const {
    int how = 0;
    return ::waitpid(pid_, &how, WUNTRACED) == pid_ && WIFSTOPPED(how);
  }

  /// Lets it go on; what it counted.
  [[nodiscard]] int counted() const {
    ::kill(pid_, SIGCONT);
    int how = 0;
    return ::waitpid(pid_, &how, 0) == pid_ && WIFEXITED(how) ? WEXITSTATUS(how) : -1;
  }

 private:
  [[nodiscard]] int run(Count* count) const {
    DdsOptions options = loopback(false);
    options.domain_id = domain_id_;
    // Else the server forgets it on a busy machine.
    options.lease_s = static_cast<std::uint32_t>(discovery_timeout.count());
    Participant participant(options);
    const auto request_type = type_support<SaveMap_Request>();
    SerializedSampleWriter asker(participant, request_topic(large_service),
                                 request_type.get_type_name(), service_qos());
    SerializedSampleReader replies(participant, reply_topic(large_service),
                                   type_support<SaveMap_Response>().get_type_name(), service_qos());
    static_cast<void>(asker.readers().wait_for_any(discovery_timeout));
    static_cast<void>(replies.events().wait_for_writer(discovery_timeout));
    const SaveMap_Request request;
    SerializedSample first;
    eprosima::fastdds::dds::SampleInfo info;
    for (int i = 0; i < requests_; ++i) {
      // Its reply shows that the server knows this reader, too.
      if (i == 1) static_cast<void>(replies.take(first, info, {}, discovery_timeout));
      eprosima::fastrtps::rtps::WriteParams params;
      params.related_sample_identity().writer_guid() = replies.guid();
      static_cast<void>(asker.write(to_bytes(request_type, &request, 0), params));
    }
    static_cast<void>(asker.wait_for_acknowledgements(discovery_timeout));
    ::raise(SIGSTOP);
    return count(replies);
  }

  pid_t pid_;
  bool is_child_;
  std::uint32_t domain_id_;
  int requests_;
};

/// Until enough of them say why there is no other.
int refusals(SerializedSampleReader& replies) {
  int refused = 0;
  SerializedSample bytes;
  eprosima::fastdds::dds::SampleInfo info;
  while (refused < min_refused && replies.take(bytes, info, {}, discovery_timeout)) {
    SaveMap_Response reply;
    if (from_bytes(type_support<SaveMap_Response>(), bytes, &reply) && reply.status().code() == 3 &&
        reply.status().reason().find("was the process stopped") != std::string::npos) {
      ++refused;
    }
  }
  return refused;
}

int next_reply(SerializedSampleReader& replies) {
  SerializedSample bytes;
  eprosima::fastdds::dds::SampleInfo info;
  return replies.take(bytes, info, {}, discovery_timeout) ? 1 : 0;
}

std::size_t memory_in_use() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  // Sanitizers keep what was freed for a while.
  return __sanitizer_get_current_allocated_bytes();
#else
  std::ifstream statm("/proc/self/statm");
  std::size_t total = 0;
  std::size_t resident = 0;
  statm >> total >> resident;
  return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
#endif
}

/// By how many bytes a second large messages may take; 0: as many as there are.
class SlowClient : public testing::TestWithParam<std::uint32_t> {};

TEST_P(SlowClient, ThatIsStoppedLosesAndIsToldAndNobodyElseNotices) {
  // Forked before this process has threads.
  const StoppingClient stopping(test_domain_id(), stopped_requests, refusals);
  DdsOptions options = loopback(false);
  options.large_message_bytes_per_s = GetParam();
  Participant server_side(options);
  ServiceServer<SaveMap_Request, SaveMap_Response> server(
      server_side, large_service, [](const SaveMap_Request&) {
        SaveMap_Response reply;
        reply.file(std::string(large_reply_bytes, 'x'));
        return reply;
      });
  const std::size_t before = memory_in_use();
  ASSERT_TRUE(stopping.wait_until_stopped());
  const auto refused = [&] {
    return server_side.service_faults().count("slow_client", large_service);
  };
  EXPECT_TRUE(test::eventually([&] { return refused() >= min_refused; }, discovery_timeout));
  {
    Participant other_side(loopback(false));
    ServiceClient<SaveMap_Request, SaveMap_Response> other(other_side, large_service);
    ASSERT_TRUE(other.wait_for_server(discovery_timeout));
    for (int i = 0; i < 20; ++i) {
      const auto began = std::chrono::steady_clock::now();
      EXPECT_TRUE(other.call(SaveMap_Request(), discovery_timeout)) << i;
      // What clients wait by default.
      EXPECT_LT(std::chrono::steady_clock::now() - began, 5s * test::slowdown) << i;
    }
  }
  // All replies to both are 440 MB.
  EXPECT_LT(memory_in_use() - before, 220'000'000U);
  EXPECT_GE(stopping.counted(), min_refused);
}

TEST(PausedClient, GetsItsReplyHoweverManyOthersGetTheirsMeanwhile) {
  const StoppingClient paused(test_domain_id(), 2, next_reply);
  Participant server_side(loopback(false));
  std::atomic<int> requests = 0;
  std::binary_semaphore is_paused(0);
  const auto answer = [&](const SaveMap_Request&) {
    SaveMap_Response reply;
    if (++requests != 2) return reply;
    // Its second one, of which no socket takes all while nobody reads.
    is_paused.acquire();
    reply.file(std::string(3 * large_reply_bytes, 'x'));
    return reply;
  };
  ServiceServer<SaveMap_Request, SaveMap_Response> server(server_side, large_service, answer);
  const bool has_stopped = paused.wait_until_stopped();
  is_paused.release();
  ASSERT_TRUE(has_stopped);
  {
    Participant other_side(loopback(false));
    ServiceClient<SaveMap_Request, SaveMap_Response> other(other_side, large_service);
    ASSERT_TRUE(other.wait_for_server(discovery_timeout));
    for (int i = 0; i < 150; ++i)
      ASSERT_TRUE(other.call(SaveMap_Request(), discovery_timeout)) << i;
  }
  EXPECT_EQ(paused.counted(), 1);
}

INSTANTIATE_TEST_SUITE_P(Networks, SlowClient, testing::Values(0U, 40'000'000U),
                         [](const auto& rate) { return rate.param == 0 ? "Fast" : "Slow"; });

}  // namespace
}  // namespace stillmap::dds
