#include "options/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <functional>

#include "tests/test_data.h"

namespace omnifleet::options {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string failure(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

Section parse(const std::string& text) {
  return Section::parse(text, "f.yaml");
}

TEST(Section, ReadsEveryType) {
  const Section s = parse(
      "flag: true\ncount: 7\nratio: 0.5\nname: r1\nlist: [1, 2.5]\nnames: [a, b]\nv2: [1, 2]\nv3: [1, 2, 3]\n"
      "points: [[0, 1], [2, 3]]\n");
  bool flag = false;
  int count = 0;
  double ratio = 0.0;
  std::string name;
  std::vector<double> list;
  std::vector<std::string> names;
  Eigen::Vector2d v2;
  Eigen::Vector3d v3;
  std::vector<Eigen::Vector2d> points;
  s.read("flag", flag);
  s.read("count", count);
  s.read("ratio", ratio);
  s.read("name", name);
  s.read("list", list);
  s.read("names", names);
  s.read("v2", v2);
  s.read("v3", v3);
  s.read("points", points);
  EXPECT_NO_THROW(s.finish());
  EXPECT_TRUE(flag);
  EXPECT_EQ(count, 7);
  EXPECT_EQ(ratio, 0.5);
  EXPECT_EQ(name, "r1");
  EXPECT_THAT(list, ElementsAre(1.0, 2.5));
  EXPECT_THAT(names, ElementsAre("a", "b"));
  EXPECT_EQ(v2, Eigen::Vector2d(1, 2));
  EXPECT_EQ(v3, Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(points, ElementsAre(Eigen::Vector2d(0, 1), Eigen::Vector2d(2, 3)));
  EXPECT_TRUE(s.isList("v2"));
  EXPECT_FALSE(s.isList("count"));
  EXPECT_FALSE(s.isList("absent"));
}

TEST(Section, KeepsDefaultOfAbsentKey) {
  const Section s = parse("");
  double value = 4.5;
  std::vector<double> list{1.0};
  s.read("value", value, kPositive);
  s.read("list", list);
  EXPECT_EQ(value, 4.5);
  EXPECT_THAT(list, ElementsAre(1.0));
  EXPECT_THAT(failure([&] { s.require("value", value); }),
              AllOf(HasSubstr("f.yaml"), HasSubstr("value: is required")));
}

TEST(Section, NamesFileLineKeyAndBoundInErrors) {
  const Section s = parse("a: 1\nb:\n  c: -2\n  d: [1, x]\n  e: .nan\n  f: 2.5\n  g: {h: 1}\n");
  const Section b = s.child("b");
  int whole = 0;
  double real = 0.0;
  std::vector<double> list;
  std::string text;
  bool flag = false;
  EXPECT_EQ(failure([&] { b.read("c", real, kPositive); }), "f.yaml:3: b.c: -2 must be positive");
  EXPECT_EQ(failure([&] { b.read("c", real, Range{0, 5}); }), "f.yaml:3: b.c: -2 must be within [0, 5]");
  EXPECT_EQ(failure([&] { b.read("c", real, kNotNegative); }), "f.yaml:3: b.c: -2 must be at least 0");
  EXPECT_THAT(failure([&] { b.read("d", list); }), StartsWith("f.yaml:4: b.d: expected a number"));
  EXPECT_THAT(failure([&] { b.read("e", real); }), StartsWith("f.yaml:5: b.e: must be a finite number"));
  EXPECT_THAT(failure([&] { b.read("f", whole); }), StartsWith("f.yaml:6: b.f: expected a whole number"));
  EXPECT_THAT(failure([&] { b.read("g", text); }), StartsWith("f.yaml:7: b.g: expected text"));
  EXPECT_THAT(failure([&] { b.read("c", flag); }), HasSubstr("expected true or false"));
  EXPECT_THAT(failure([&] { b.read("c", text, {"one", "two"}); }), HasSubstr("'-2' must be one of one, two"));
  EXPECT_THAT(failure([&] { s.child("a"); }), AllOf(StartsWith("f.yaml:1"), HasSubstr("expected a mapping")));
  EXPECT_THAT(failure([&] { b.list("c"); }), HasSubstr("expected a list"));
}

TEST(Section, RejectsVectorOfWrongLength) {
  const Section s = parse("v: [1, 2, 3]\np: [[1, 2], [3]]\n");
  Eigen::Vector2d v;
  std::vector<Eigen::Vector2d> p;
  EXPECT_THAT(failure([&] { s.read("v", v); }), HasSubstr("f.yaml:1: v: expected two numbers"));
  EXPECT_THAT(failure([&] { s.read("p", p); }), HasSubstr("f.yaml:2: p: expected a list of points"));
}

TEST(Section, RejectsUnknownKey) {
  const Section s = parse("known: 1\nunknwon: 2\n");
  double value = 0.0;
  s.read("known", value);
  EXPECT_THAT(failure([&] { s.finish(); }),
              AllOf(StartsWith("f.yaml:2: unknwon: unknown key"), HasSubstr("known here: known")));
}

TEST(Section, OverridesKeyByKeyInLaterLayers) {
  Section base = Section::parse("a: 1\nsub:\n  x: 1\n  y: 2\n", "base.yaml");
  base.overlay(Section::parse("sub:\n  y: 20\n", "top.yaml"));
  const Section sub = base.child("sub");
  double x = 0.0, y = 0.0;
  sub.read("x", x);
  sub.read("y", y);
  EXPECT_EQ(x, 1.0);
  EXPECT_EQ(y, 20.0);
  EXPECT_THAT(failure([&] { sub.read("y", y, Range{0, 10}); }), StartsWith("top.yaml:2: sub.y:"));
  EXPECT_THAT(failure([&] { sub.read("x", x, Range{5, 10}); }), StartsWith("base.yaml:3: sub.x:"));
  EXPECT_THAT(base.keys(), ElementsAre("a", "sub"));
}

TEST(Section, ReadsListOfMappings) {
  const Section s = parse("cameras:\n  - {name: a}\n  - {name: b, size: -1}\n");
  const std::vector<Section> cameras = s.list("cameras");
  ASSERT_EQ(cameras.size(), 2u);
  std::string name;
  cameras[1].read("name", name);
  EXPECT_EQ(name, "b");
  double size = 0.0;
  EXPECT_THAT(failure([&] { cameras[1].read("size", size, kPositive); }),
              StartsWith("f.yaml:3: cameras[1].size:"));
  EXPECT_TRUE(s.list("absent").empty());
}

TEST(Section, RejectsDuplicateKey) {
  EXPECT_THAT(failure([&] { parse("a: 1\nb: 2\na: 3\n"); }),
              AllOf(StartsWith("f.yaml:3: a:"), HasSubstr("first in line 1")));
  EXPECT_THAT(failure([&] { parse("top:\n  - {x: 1}\n  - {x: 1, y: 2, x: 3}\n"); }),
              StartsWith("f.yaml:3: x:"));
  EXPECT_EQ(failure([&] { parse("top:\n  - {x: 1}\n  - {x: 2}\nother: {x: 3}\n"); }), "");
}

TEST(Section, RejectsFileThatIsNoMapping) {
  const test::TempFolder folder;
  EXPECT_THAT(failure([&] { Section::load(folder / "none.yaml"); }),
              AllOf(HasSubstr("none.yaml"), HasSubstr("cannot be read")));
  EXPECT_THAT(failure([&] { Section::load(folder.path()); }), HasSubstr("cannot be read"));
  std::ofstream(folder / "list.yaml") << "- 1\n- 2\n";
  EXPECT_THAT(failure([&] { Section::load(folder / "list.yaml"); }),
              HasSubstr("list.yaml:1: expected a mapping"));
  std::ofstream(folder / "bad.yaml") << "a: 1\nb: [1, 2\nc: 3\n";
  EXPECT_THAT(failure([&] { Section::load(folder / "bad.yaml"); }),
              AllOf(HasSubstr("bad.yaml:"), HasSubstr("not valid YAML")));
}

TEST(Section, SaysWhyFileCannotBeRead) {
  EXPECT_THAT(failure([] { Section::load("/no/such/file.yaml"); }),
              AllOf(StartsWith("/no/such/file.yaml: "), HasSubstr("No such file or directory")));
  EXPECT_THAT(failure([] { Section::load("/"); }), HasSubstr("Is a directory"));
  if (::geteuid() == 0) GTEST_SKIP() << "root may read every file";
  const std::string path = ::testing::TempDir() + "unreadable.yaml";
  std::ofstream(path) << "a: 1\n";
  ASSERT_EQ(::chmod(path.c_str(), 0), 0);
  EXPECT_THAT(failure([&] { Section::load(path); }), HasSubstr("Permission denied"));
  ::unlink(path.c_str());
}

TEST(Section, NamesFileOfEmptyName) {
  for (const char* key : {"~", "\"\"", "? "}) {
    const Section s = parse(std::string("robots:\n  ") + key + ": {height_m: 1}\n").child("robots");
    EXPECT_THAT(failure([&] { s.keys(); }), AllOf(StartsWith("f.yaml:2: robots: "), HasSubstr("empty")))
        << key;
  }
  double value = 0.0;
  EXPECT_THAT(failure([&] { parse("a: 1\n").child("robots").child("r1").require("height_m", value); }),
              StartsWith("f.yaml: robots.r1.height_m: "));
}

}  // namespace
}  // namespace omnifleet::options
