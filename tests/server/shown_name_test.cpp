#include "server/monitoring/shown_name.hpp"

#include <gtest/gtest.h>

#include <string>

namespace stillmap::server {
namespace {

TEST(ShownName, LeavesNamesAsTheyAre) {
  const std::string longest(100, 'x');
  for (const std::string& name :
       {std::string(), std::string("base_link"), std::string("front/v\u00e9lo \U0001F916"), longest,
        // The last before the surrogates, the last of all, and the first
        // of three and of four bytes.
        std::string("\uD7FF\U0010FFFF\u0800\U00010000")}) {
    EXPECT_EQ(shown_name(name), name);
  }
}

TEST(ShownName, CutsLongOnesBetweenCharacters) {
  EXPECT_EQ(shown_name(std::string(1'000'000, 'x')), std::string(100, 'x') + "...");
  EXPECT_EQ(shown_name(std::string(99, 'x') + "\u00e9"), std::string(99, 'x') + "...");
}

TEST(ShownName, ReplacesControlCharacters) {
  EXPECT_EQ(shown_name("lidar\nerror the\tmap\x1b[2J\x7f"), "lidar?error the?map?[2J?");
  EXPECT_EQ(shown_name(std::string("a\0b", 3)), "a?b");
  // A next line and a line separator.
  EXPECT_EQ(shown_name("a\xC2\x85_\xE2\x80\xA8z"), "a?_?z");
  EXPECT_EQ(shown_name("a\u202Eb\u2066\u200F"), "a?b??");
}

TEST(ShownName, ReplacesBytesThatAreNoUtf8) {
  EXPECT_EQ(shown_name("\xFF\x80z"), "??z");
  // Cut off, of more bytes than needed, a surrogate, and beyond the last character.
  EXPECT_EQ(shown_name("\xE2\x82"), "??");
  EXPECT_EQ(shown_name("\xC0\xAFz"), "??z");
  EXPECT_EQ(shown_name("\xED\xA0\x80z"), "???z");
  EXPECT_EQ(shown_name("\xF4\x90\x80\x80z"), "????z");
}

}  // namespace
}  // namespace stillmap::server
