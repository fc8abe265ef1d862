#include "core/geodesy/datum.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

TEST(Datum, TextComesBackToTheMillimetre) {
  const Datum datum{48.13712345, -11.57598765, -3.25, 271.1234};
  const Datum back = datum_from_text(to_text(datum));
  EXPECT_NEAR(back.latitude_deg, datum.latitude_deg, 1e-8);
  EXPECT_NEAR(back.longitude_deg, datum.longitude_deg, 1e-8);
  EXPECT_NEAR(back.altitude_m, datum.altitude_m, 1e-3);
  EXPECT_NEAR(back.x_axis_azimuth_deg, datum.x_axis_azimuth_deg, 1e-4);
}

TEST(Datum, RefusesWhatIsNoPlace) {
  for (const char* text : {"", "48", "48,11,1,2,3", "48,x", "nan,11", "48,inf", "85,11", "48,181",
                           "48,11,1e6", "48,11,0,400"}) {
    EXPECT_THAT(message_of<std::invalid_argument>([&] { (void)datum_from_text(text); }),
                testing::HasSubstr(std::string("'") + text + "'"))
        << text;
  }
}

}  // namespace
}  // namespace stillmap
