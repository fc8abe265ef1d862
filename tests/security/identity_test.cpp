#include "idl/dds/security/identity.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "idl/dds/security/authority.hpp"
#include "idl/dds/security/documents.hpp"
#include "idl/dds/security/signed_document.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class IdentityTest : public testing::Test {
 protected:
  [[nodiscard]] IdentityFaults check() const { return check_identity(folder_, now_); }

  /// The only fault.
  [[nodiscard]] std::string fault() const {
    const IdentityFaults found = check();
    EXPECT_EQ(found.faults.size(), 1U);
    return found.faults.empty() ? std::string() : found.faults.front();
  }

  void spoil(const std::string& file, const std::string& text) const {
    std::ofstream(folder_ / file, std::ios::trunc) << text;
  }

  std::chrono::sys_seconds now_ =
      std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  ScratchFolder scratch_;
  Authority authority_ = Authority::make(scratch_ / "keys", 100);
  Access access_{.publish = {"rt/points"}, .subscribe = {"rt/stillmap/status"}};
  fs::path folder_ = authority_.add("front_lidar", "sensor", access_, Validity::days_from_now(50));
};

TEST_F(IdentityTest, TellsWhoItIsAndWhatItMayDo) {
  const IdentityFaults found = check();
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_THAT(found.warnings, IsEmpty());
  const Identity identity = load_identity(folder_);
  EXPECT_EQ(identity.name, "front_lidar");
  EXPECT_EQ(identity.role, "sensor");
  EXPECT_TRUE(identity.access.may_publish("rt/points"));
  EXPECT_FALSE(identity.access.may_publish("rt/stillmap/status"));
}

TEST_F(IdentityTest, ExpiresWithTheWayToANewOne) {
  now_ += std::chrono::days(51);
  EXPECT_THAT(check().faults,
              testing::Each(AllOf(HasSubstr("expired on"), HasSubstr("stillmap security add"),
                                  HasSubstr("front_lidar --replace"))));
  EXPECT_EQ(check().faults.size(), 2U);  // certificate and permissions
}

TEST_F(IdentityTest, WarnsBeforeItExpires) {
  now_ += std::chrono::days(45);
  EXPECT_THAT(check().faults, IsEmpty());
  EXPECT_THAT(check().warnings, testing::Contains(HasSubstr("expires on")));
}

TEST_F(IdentityTest, BlamesTheClockForACertificateOfTheFuture) {
  now_ -= std::chrono::days(1000);
  EXPECT_THAT(check().faults, testing::Each(HasSubstr("set the clock")));
}

TEST_F(IdentityTest, OfTwoAuthoritiesIsRefused) {
  const Authority other = Authority::make(scratch_ / "other", 100);
  other.certificate().write(folder_ / "identity_ca.cert.pem");
  EXPECT_THAT(fault(), AllOf(HasSubstr("was not issued by the authority"), HasSubstr("mixed")));
}

TEST_F(IdentityTest, WithPermissionsOfSomebodyElseIsRefused) {
  const auto other = authority_.add("boss", "operator", access_, Validity::days_from_now(50));
  fs::copy_file(other / "permissions.p7s", folder_ / "permissions.p7s",
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(fault(), AllOf(HasSubstr("is for CN=boss"), HasSubstr("of CN=front_lidar")));
}

TEST_F(IdentityTest, WithTheKeyOfSomebodyElseIsRefused) {
  PrivateKey::make().write(folder_ / "key.pem");
  EXPECT_THAT(fault(), HasSubstr("key.pem is not the key of cert.pem"));
}

TEST_F(IdentityTest, WithChangedPermissionsIsRefused) {
  std::string document = content_of(folder_ / "permissions.p7s");
  document.replace(document.find("rt/points"), 9, "rt/planet");
  spoil("permissions.p7s", document);
  EXPECT_THAT(fault(), HasSubstr("permissions.p7s was changed"));
}

TEST_F(IdentityTest, NamesWhatIsMissingOrBroken) {
  fs::remove(folder_ / "governance.p7s");
  EXPECT_THAT(fault(), AllOf(HasSubstr("governance.p7s"), HasSubstr("No such file")));
  spoil("governance.p7s", "");
  EXPECT_THAT(fault(), HasSubstr("governance.p7s was changed, or not signed"));
}

TEST_F(IdentityTest, WarnsOfAKeyThatOthersCanRead) {
  fs::permissions(folder_ / "key.pem", fs::perms::group_read, fs::perm_options::add);
  EXPECT_THAT(check().faults, IsEmpty());
  EXPECT_THAT(check().warnings, ElementsAre(HasSubstr("chmod 600")));
}

TEST_F(IdentityTest, IsNotTheFolderOfAll) {
  EXPECT_THAT(check_identity(scratch_ / "keys", now_).faults,
              ElementsAre(HasSubstr("name one of them")));
  EXPECT_THAT(check_identity(scratch_ / "nowhere", now_).faults,
              ElementsAre(HasSubstr("is no folder")));
}

TEST_F(IdentityTest, IsMadeOnceAndReplacedOnDemand) {
  const auto add = [&](const std::string& name, bool replace) {
    (void)authority_.add(name, "sensor", access_, Validity::days_from_now(5), replace);
  };
  EXPECT_THAT(message_of<SecurityError>([&] { add("front_lidar", false); }),
              HasSubstr("--replace"));
  const std::string before = content_of(folder_ / "cert.pem");
  add("front_lidar", true);
  EXPECT_NE(content_of(folder_ / "cert.pem"), before);
  EXPECT_THAT(check().faults, IsEmpty());
  for (const std::string name : {"", "../up", "a b", "authority"}) {
    EXPECT_THROW(add(name, false), SecurityError) << name;
  }
  EXPECT_THROW((void)Authority::make(scratch_ / "keys", 5), SecurityError);
  EXPECT_THROW((void)Authority::open(scratch_ / "nowhere"), SecurityError);
}

/// No file takes a byte more, as on a full disk.
class FullDisk {
 public:
  FullDisk() : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit none{0, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &none);
  }
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int);
};

TEST_F(IdentityTest, StaysAsItIsWhenItsSuccessorCannotBeWritten) {
  const std::string before = content_of(folder_ / "key.pem");
  std::string told;
  try {
    const FullDisk full;
    (void)authority_.add("front_lidar", "sensor", access_, Validity::days_from_now(5), true);
  } catch (const SecurityError& error) {
    told = error.what();
  }
  EXPECT_THAT(told, AllOf(HasSubstr("key.pem"), HasSubstr("cannot be written")));
  EXPECT_EQ(content_of(folder_ / "key.pem"), before);
  EXPECT_THAT(check().faults, IsEmpty());
  EXPECT_THAT(check().warnings, IsEmpty());
  EXPECT_THAT(authority_.identities(), ElementsAre(folder_));
}

TEST_F(IdentityTest, OfAnAuthorityThatCouldNotBeWrittenLeavesRoomForAnother) {
  bool is_refused = false;
  try {
    const FullDisk full;
    (void)Authority::make(scratch_ / "late", 5);
  } catch (const SecurityError&) {
    is_refused = true;
  }
  EXPECT_TRUE(is_refused);
  EXPECT_TRUE(fs::is_empty(scratch_ / "late"));
  EXPECT_NO_THROW((void)Authority::make(scratch_ / "late", 5));
}

}  // namespace
}  // namespace stillmap::dds
