#include "dataset/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dataset/atomic_file.h"
#include "options/options.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Parse, ParsesTimes) {
  TimeNs t = 0;
  EXPECT_TRUE(parseTime(" 1700000000000000001 ", t));
  EXPECT_EQ(t, 1700000000000000001);
  EXPECT_TRUE(parseTime("-5", t));
  for (const char* bad : {"", "1.0", "1e9", "0x10", "12 3", "99999999999999999999", "nan", "--1"}) {
    EXPECT_FALSE(parseTime(bad, t)) << bad;
  }
}

TEST(Parse, ParsesNumbers) {
  double x = 0.0;
  EXPECT_TRUE(parseNumber("+1.5e-3", x));
  EXPECT_EQ(x, 1.5e-3);
  for (const char* bad : {"", "inf", "-inf", "nan", "1,5", "1.5m", "1e999", "+", "."}) {
    EXPECT_FALSE(parseNumber(bad, x)) << bad;
  }
}

TEST(Parse, KeepsNanosecondsOfSeconds) {
  TimeNs t = 0;
  EXPECT_TRUE(parseSeconds("1700000000.123456789", t));
  EXPECT_EQ(t, 1700000000123456789);
  EXPECT_TRUE(parseSeconds("1305031098.6659", t));
  EXPECT_EQ(t, 1305031098665900000);
  EXPECT_TRUE(parseSeconds("12", t));
  EXPECT_EQ(t, 12000000000);
  EXPECT_TRUE(parseSeconds("1.2345678901234", t)) << "more digits than nanoseconds";
  EXPECT_EQ(t, 1234567890);
  EXPECT_TRUE(parseSeconds("-0.5", t));
  EXPECT_EQ(t, -500000000);
  EXPECT_TRUE(parseSeconds("1.5e3", t));
  EXPECT_EQ(t, 1500000000000);
  for (const char* bad : {"", ".", "1.2.3", "nan", "1e300", "abc"}) EXPECT_FALSE(parseSeconds(bad, t)) << bad;
}

TEST(Split, SplitsAtSeparatorsAndBlanks) {
  std::vector<std::string_view> fields;
  split(" a , b,,c ", ',', fields);
  EXPECT_THAT(fields, ElementsAre("a", "b", "", "c"));
  split("10,", ',', fields);
  EXPECT_THAT(fields, ElementsAre("10", ""));
  split("1   2\t3 ", ' ', fields);
  EXPECT_THAT(fields, ElementsAre("1", "2", "3"));
}

TEST(ReadRows, CountsLinesAndAcceptsAnyLineEnding) {
  const test::TempFolder folder;
  writeAtomic(folder / "a.csv", "#head\r\n1\r\n\r\nbad\r\n 2");
  std::vector<std::string> warnings, seen;
  readRows(folder / "a.csv", ',', warnings, [&](const std::vector<std::string_view>& fields) -> std::string {
    if (fields[0] == "bad") return "is bad";
    seen.emplace_back(fields[0]);
    return {};
  });
  EXPECT_THAT(seen, ElementsAre("1", "2"));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("a.csv:4: is bad (row ignored)")));
}

TEST(ReadRows, RemovesByteOrderMark) {
  const test::TempFolder folder;
  std::vector<std::string> warnings, seen;
  const auto keep = [&](const std::vector<std::string_view>& fields) -> std::string {
    seen.emplace_back(fields[0]);
    return {};
  };
  writeAtomic(folder / "a.csv",
              "\xEF\xBB\xBF#head\n1\n\xEF\xBB\xBF"
              "2\n");
  readRows(folder / "a.csv", ',', warnings, keep);
  EXPECT_THAT(seen, ElementsAre("1",
                                "\xEF\xBB\xBF"
                                "2"))
      << "removed before a header; elsewhere it is part of a row";
  seen.clear();
  writeAtomic(folder / "b.csv",
              "\xEF\xBB\xBF"
              "1\n");
  readRows(folder / "b.csv", ',', warnings, keep);
  EXPECT_THAT(seen, ElementsAre("1")) << "removed before a row";
  seen.clear();
  writeAtomic(folder / "c.csv", "\xEF\xBB\xBF");
  readRows(folder / "c.csv", ',', warnings, keep);
  EXPECT_THAT(seen, testing::IsEmpty()) << "a file that contains only the mark";
}

TEST(ReadRows, RejectsFileWithoutValidRow) {
  const test::TempFolder folder;
  std::vector<std::string> warnings;
  const auto refuse = [](const std::vector<std::string_view>&) { return std::string("no"); };
  writeAtomic(folder / "a.csv", "x\ny\n");
  EXPECT_THROW(readRows(folder / "a.csv", ',', warnings, refuse), options::Error);
  writeAtomic(folder / "b.csv", "# nothing recorded\n");
  EXPECT_NO_THROW(readRows(folder / "b.csv", ',', warnings, refuse));
  EXPECT_THROW(readRows(folder / "none.csv", ',', warnings, refuse), options::Error);
}

}  // namespace
}  // namespace omnifleet::dataset
