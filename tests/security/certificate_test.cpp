#include "idl/dds/security/certificate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "idl/dds/security/signed_document.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::dds {
namespace {

using ::testing::HasSubstr;

struct Pair {
  PrivateKey key = PrivateKey::make();
  Certificate certificate =
      Certificate::make_authority(key, "Test authority", Validity::days_from_now(10));
};

TEST(CertificateTest, NamesItsSubjectInTheOrderThatPermissionsNeed) {
  const Pair authority;
  const Certificate issued =
      Certificate::issue(PrivateKey::make(), "arm", "planner", Validity::days_from_now(5),
                         authority.certificate, authority.key);
  EXPECT_EQ(issued.subject(), "CN=arm,OU=planner,O=Stillmap");
  EXPECT_EQ(issued.name(), "arm");
  EXPECT_EQ(issued.role(), "planner");
}

TEST(CertificateTest, KnowsItsIssuerItsKeyAndItsDates) {
  const Pair authority, other;
  const PrivateKey key = PrivateKey::make();
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const Validity validity{.from = now - std::chrono::hours(3), .to = now - std::chrono::hours(1)};
  const Certificate issued =
      Certificate::issue(key, "arm", "planner", validity, authority.certificate, authority.key);
  EXPECT_TRUE(issued.is_signed_by(authority.certificate));
  EXPECT_FALSE(issued.is_signed_by(other.certificate));
  EXPECT_TRUE(issued.belongs_to(key));
  EXPECT_FALSE(issued.belongs_to(other.key));
  EXPECT_EQ(issued.validity().from, validity.from);
  EXPECT_EQ(issued.validity().to, validity.to);
  EXPECT_FALSE(issued.validity().contains(now));
}

TEST(CertificateTest, SurvivesAFileAndHidesItsKey) {
  const ScratchFolder folder;
  const Pair authority;
  authority.certificate.write(folder / "cert.pem");
  authority.key.write(folder / "key.pem");
  struct stat facts {};
  ASSERT_EQ(::stat((folder / "key.pem").c_str(), &facts), 0);
  EXPECT_EQ(facts.st_mode & 0777, 0600U);
  const Certificate read = Certificate::read(folder / "cert.pem");
  EXPECT_EQ(read.subject(), authority.certificate.subject());
  EXPECT_TRUE(read.belongs_to(PrivateKey::read(folder / "key.pem")));
}

TEST(CertificateTest, NamesFilesThatAreNone) {
  const ScratchFolder folder;
  const auto broken = folder.file("cert.pem", "-----BEGIN CERTIFICATE-----\nnonsense\n");
  EXPECT_THAT(message_of<SecurityError>([&] { (void)Certificate::read(broken); }),
              HasSubstr("cert.pem is no certificate"));
  EXPECT_THAT(message_of<SecurityError>([&] { (void)PrivateKey::read(broken); }),
              HasSubstr("cert.pem is no private key"));
  EXPECT_THAT(message_of<SecurityError>([&] { (void)Certificate::read(folder / "none.pem"); }),
              HasSubstr("No such file"));
}

TEST(SignedDocumentTest, GivesTheTextBackToWhoKnowsTheSigner) {
  const Pair authority, other;
  const std::string text = "<dds>\n<topic>rt/points</topic>\n</dds>\n";
  const std::string document = sign_document(text, authority.certificate, authority.key);
  const auto read = verified_text(document, authority.certificate);
  ASSERT_TRUE(read);
  EXPECT_THAT(*read, HasSubstr("<topic>rt/points</topic>"));
  EXPECT_FALSE(verified_text(document, other.certificate));
}

TEST(SignedDocumentTest, RefusesWhatWasChangedOrNeverSigned) {
  const Pair authority;
  std::string document = sign_document("a planner may read", authority.certificate, authority.key);
  document.replace(document.find("read"), 4, "rule");
  EXPECT_FALSE(verified_text(document, authority.certificate));
  EXPECT_FALSE(verified_text("a planner may rule", authority.certificate));
  EXPECT_FALSE(verified_text("", authority.certificate));
}

}  // namespace
}  // namespace stillmap::dds
