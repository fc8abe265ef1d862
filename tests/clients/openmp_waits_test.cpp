#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/clients/process.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::test {
namespace {

using testing::HasSubstr;
using testing::Not;

/// libgomp prints how it was set up when a program starts.
class OpenMpWaits : public testing::Test {
 protected:
  OpenMpWaits() { setenv("OMP_DISPLAY_ENV", "verbose", 1); }
  ~OpenMpWaits() override {
    for (const char* name : {"OMP_DISPLAY_ENV", "OMP_WAIT_POLICY", "GOMP_SPINCOUNT"}) {
      unsetenv(name);
    }
  }
  ProcessResult run() { return run_stillmap("--version", folder_.path()); }

  ScratchFolder folder_;
};

TEST_F(OpenMpWaits, AreShort) {
  unsetenv("OMP_WAIT_POLICY");
  unsetenv("GOMP_SPINCOUNT");
  const ProcessResult result = run();
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_FALSE(result.out.empty());
  EXPECT_THAT(result.err, HasSubstr("GOMP_SPINCOUNT = '1000'"));
}

TEST_F(OpenMpWaits, AreAsTheEnvironmentSays) {
  unsetenv("GOMP_SPINCOUNT");
  setenv("OMP_WAIT_POLICY", "ACTIVE", 1);
  EXPECT_THAT(run().err, Not(HasSubstr("GOMP_SPINCOUNT = '1000'")));
  unsetenv("OMP_WAIT_POLICY");
  setenv("GOMP_SPINCOUNT", "77", 1);
  EXPECT_THAT(run().err, HasSubstr("GOMP_SPINCOUNT = '77'"));
}

}  // namespace
}  // namespace stillmap::test
