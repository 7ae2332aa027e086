#include "options/range_check.h"

#include <gtest/gtest.h>

namespace omnifleet::options {
namespace {

/// Result of parsing `--seconds TEXT`: the number, or the message of the rejection.
struct Parsed {
  double seconds = -1.0;
  std::string refusal;
};

Parsed parse(const std::string& text) {
  CLI::App app;
  Parsed parsed;
  app.add_option("--seconds", parsed.seconds)->check(within({0.5, 60.0}));
  try {
    app.parse("--seconds=" + text);
  } catch (const CLI::ParseError& error) {
    parsed.refusal = error.what();
  }
  return parsed;
}

TEST(RangeCheck, AcceptsNumbersWithinBoundsIncluded) {
  for (const double value : {0.5, 7.25, 60.0}) {
    const Parsed parsed = parse(std::to_string(value));
    EXPECT_EQ(parsed.refusal, "");
    EXPECT_EQ(parsed.seconds, value);
  }
}

TEST(RangeCheck, RejectsOtherTextAndNamesTheBounds) {
  for (const char* text :
       {"0.49", "60.01", "-7", "nan", "-nan", "NaN", "inf", "-inf", "1e999", "7s", "seven", ""}) {
    const Parsed parsed = parse(text);
    EXPECT_NE(parsed.refusal.find("--seconds"), std::string::npos) << "'" << text << "': " << parsed.refusal;
    EXPECT_EQ(parsed.seconds, -1.0) << text;
    if (*text) {
      EXPECT_NE(parsed.refusal.find("0.5"), std::string::npos) << parsed.refusal;
    }
  }
}

TEST(DomainNumber, NamesTheVariableThatHoldsTheValue) {
  const CLI::Validator check = domainNumber();
  for (const char* good : {"0", "232"}) EXPECT_EQ(check(good), "");
  ::unsetenv("OMNIFLEET_DOMAIN");
  EXPECT_EQ(check("233"), "'233' is not a whole number within [0, 232]");
  ::setenv("OMNIFLEET_DOMAIN", "abc", 1);
  EXPECT_EQ(check("abc"),
            "'abc' (from the environment variable OMNIFLEET_DOMAIN) is not a whole number within [0, 232]");
  EXPECT_EQ(check("-1"), "'-1' is not a whole number within [0, 232]") << "given as an option";
  ::unsetenv("OMNIFLEET_DOMAIN");
}

}  // namespace
}  // namespace omnifleet::options
