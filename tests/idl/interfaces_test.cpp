#include "idl/dds/interfaces.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/dds/participant.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

// RFC 5737 keeps it for documents: no machine has it.
const std::string nowhere = "203.0.113.9";

TEST(InterfacesTest, AreThoseOfThisMachine) {
  const std::vector<std::string> own = own_addresses();
  EXPECT_THAT(own, Contains("127.0.0.1"));
  EXPECT_THAT(unknown_interfaces(own, own), IsEmpty());
  const std::vector<std::string> some{"127.0.0.1", nowhere};
  EXPECT_THAT(unknown_interfaces(some, std::vector<std::string>{"127.0.0.1", "10.0.0.7"}),
              AllOf(HasSubstr("interfaces: " + nowhere + " is no address"),
                    HasSubstr("those have 127.0.0.1, 10.0.0.7")));
}

TEST(InterfacesTest, AParticipantIsNotMadeWithAnAddressThatTheMachineLacks) {
  DdsOptions options = loopback(false);
  options.interfaces = {nowhere};
  EXPECT_THAT([&] { Participant{options}; },
              ThrowsMessage<DdsError>(HasSubstr(nowhere + " is no address")));
}

}  // namespace
}  // namespace stillmap::dds
