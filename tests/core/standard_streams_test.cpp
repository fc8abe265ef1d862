#include "core/process/standard_streams.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <initializer_list>

namespace stillmap {
namespace {

/// What `look` returns in a process that was started without these streams.
int result_without(std::initializer_list<int> streams, int (*look)()) {
  const pid_t child = fork();
  if (child == 0) {
    for (const int stream : streams) close(stream);
    open_missing_standard_streams();
    _exit(look());
  }
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// A server's log went into the lock of its map.
TEST(StandardStreams, FilesTakeNoneOfTheirNumbers) {
  const auto opened = [] { return open("/dev/null", O_RDWR); };
  EXPECT_GT(result_without({}, opened), STDERR_FILENO);
  EXPECT_GT(result_without({STDERR_FILENO}, opened), STDERR_FILENO);
  EXPECT_GT(result_without({STDOUT_FILENO}, opened), STDERR_FILENO);
  EXPECT_GT(result_without({STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}, opened), STDERR_FILENO);
}

TEST(StandardStreams, WhatCannotBePrintedIsAFailure) {
  const auto printed = [] { return write(STDOUT_FILENO, "x", 1) == 1 ? 1 : 0; };
  const auto complained = [] { return write(STDERR_FILENO, "x", 1) == 1 ? 1 : 0; };
  const auto asked = [] {
    char byte = 0;
    return read(STDIN_FILENO, &byte, 1) == 0 ? 1 : 0;
  };
  EXPECT_EQ(result_without({STDOUT_FILENO}, printed), 0);
  EXPECT_EQ(result_without({STDERR_FILENO}, complained), 1);
  EXPECT_EQ(result_without({STDIN_FILENO}, asked), 1);
}

}  // namespace
}  // namespace stillmap
