// The decision about a candidate from its evidence. Each row changes one piece of evidence of a clear
// obstacle.

#include "global_merger/verdict.h"

#include <gtest/gtest.h>

#include <functional>
#include <set>

namespace omnifleet::global_merger {
namespace {

constexpr std::uint8_t kLow = static_cast<std::uint8_t>(Quality::kLowContrast),
                       kDisagree = static_cast<std::uint8_t>(Quality::kDisagreeing),
                       kSliver = static_cast<std::uint8_t>(Quality::kThin);

/// Many views of one camera agree on an upright obstacle that stands alone.
Evidence clearObstacle() {
  Evidence e;
  e.views = 40;
  e.from_camera = true;
  e.kind = ObjectKind::kObstacle;
  e.has_shape = true;
  e.spread = 0.5;
  e.rms_m = 0.003;
  e.sigma_m = 0.003;
  e.height_m = 0.3;
  e.height_sigma_m = 0.002;
  e.seen = e.faced = e.alone = 1.0;
  return e;
}

struct Expected {
  Decision decision = Decision::kObstacle;
  Reason reason = Reason::kNone;
  bool to_report = false;
  std::uint8_t quality = 0;
  bool is_flat = false;
};
constexpr Expected kAnObstacle{};

constexpr Expected withQuality(std::uint8_t quality) {
  return {Decision::kObstacle, Reason::kNone, false, quality, false};
}
constexpr Expected asRejected(Reason reason, bool to_report = true) {
  return {Decision::kRejected, reason, to_report, 0, false};
}
constexpr Expected asStructure(Reason reason) {
  return {Decision::kStructure, reason, false, 0, false};
}
constexpr Expected asUndecided(Reason reason) {
  return {Decision::kUndecided, reason, false, 0, false};
}

struct Row {
  const char* name;
  std::function<void(Evidence&)> change;
  Expected expected;
};

void expectVerdicts(const std::vector<Row>& rows, const MergerOptions& options = {}, bool is_final = true) {
  for (const Row& row : rows) {
    Evidence e = clearObstacle();
    row.change(e);
    const Verdict verdict = verdictOf(e, options, is_final);
    EXPECT_EQ(static_cast<int>(verdict.decision), static_cast<int>(row.expected.decision)) << row.name;
    EXPECT_STREQ(toString(verdict.reason), toString(row.expected.reason)) << row.name;
    EXPECT_EQ(verdict.to_report, row.expected.to_report) << row.name;
    EXPECT_EQ(verdict.quality, row.expected.quality) << row.name;
    EXPECT_EQ(verdict.is_flat, row.expected.is_flat) << row.name;
  }
}

TEST(Verdict, IsAnObstacleForClearEvidence) {
  const std::vector<Row> row{{"clear", [](Evidence&) {}, kAnObstacle}};
  expectVerdicts(row);
  expectVerdicts(row, {}, false);
}

TEST(Verdict, WaitsForViewsAndKindOnlyInLiveRuns) {
  const auto two_views = [](Evidence& e) { e.views = 2; };
  const auto three_views = [](Evidence& e) { e.views = 3; };
  const auto no_kind = [](Evidence& e) { e.kind = ObjectKind::kUnknown; };
  expectVerdicts({{"2 views", two_views, asUndecided(Reason::kFewViews)},
                  {"3 views", three_views, kAnObstacle},
                  {"kind unknown", no_kind, asUndecided(Reason::kUndecidedKind)}},
                 {}, false);
  expectVerdicts({{"2 views", two_views, kAnObstacle}, {"kind unknown", no_kind, kAnObstacle}});
  MergerOptions patient;
  patient.min_views = 41;
  expectVerdicts({{"40 of 41 views", [](Evidence&) {}, asUndecided(Reason::kFewViews)}}, patient, false);
}

TEST(Verdict, IsARobotWithTheBodyOfASilentOne) {
  const Expected robot{Decision::kRobot, Reason::kSilentRobot, false, 0, false};
  const std::vector<Row> rows{
      {"unknown kind",
       [](Evidence& e) {
         e.kind = ObjectKind::kUnknown;
         e.fits_silent_robot = true;
       },
       robot},
      {"known as obstacle", [](Evidence& e) { e.fits_silent_robot = true; }, kAnObstacle}};
  expectVerdicts(rows);
  expectVerdicts(rows, {}, false);
}

TEST(Verdict, RejectsWhatLiesBehindAPossibleMirror) {
  // The mirror itself is reported once, not each candidate behind it.
  const Expected behind = asRejected(Reason::kPossibleMirror, false);
  const std::vector<Row> rows{
      {"obstacle", [](Evidence& e) { e.is_mirrored = true; }, behind},
      {"without shape", [](Evidence& e) { e.is_mirrored = true, e.has_shape = false; }, behind}};
  expectVerdicts(rows);
}

TEST(Verdict, RejectsDisagreeingViewsWhereFloorWasSeen) {
  const auto disputed = [](double spread, int floor) {
    return [=](Evidence& e) { e.spread = spread, e.floor_before = floor; };
  };
  expectVerdicts({{"views agree", disputed(1.2, 40), withQuality(kLow)},
                  {"no floor", disputed(1.6, 0), withQuality(kDisagree)},
                  {"both", disputed(1.6, 40), asRejected(Reason::kNoShape)}});
}

TEST(Verdict, NeedsOneShapeAtACertainPlace) {
  expectVerdicts({{"no shape", [](Evidence& e) { e.has_shape = false; }, asRejected(Reason::kNoShape)},
                  {"spread", [](Evidence& e) { e.spread = 4.01; }, asRejected(Reason::kNoShape)},
                  {"largest spread", [](Evidence& e) { e.spread = 4.0; }, withQuality(kDisagree)},
                  {"place", [](Evidence& e) { e.sigma_m = 0.051; }, asRejected(Reason::kUncertainPlace)},
                  {"largest σ", [](Evidence& e) { e.sigma_m = 0.05; }, kAnObstacle},
                  {"silent robot without shape",
                   [](Evidence& e) {
                     e.has_shape = false;
                     e.fits_silent_robot = true;
                   },
                   asRejected(Reason::kNoShape, false)},
                  {"2 views without shape",
                   [](Evidence& e) {
                     e.has_shape = false;
                     e.views = 2;
                   },
                   asRejected(Reason::kNoShape, false)}});
  MergerOptions loose;
  loose.max_spread = 5.0;
  loose.max_sigma_m = 0.06;
  expectVerdicts({{"spread", [](Evidence& e) { e.spread = 4.01; }, withQuality(kDisagree)},
                  {"place", [](Evidence& e) { e.sigma_m = 0.051; }, kAnObstacle}},
                 loose);
}

TEST(Verdict, RejectsAPieceThatIsCutInAllOfItsFewViews) {
  const auto cut = [](int views, int cut_views) {
    return [=](Evidence& e) { e.views = views, e.cut_views = cut_views; };
  };
  const std::vector<Row> rows{{"2 views", cut(2, 2), asRejected(Reason::kPiece, false)},
                              {"3 views", cut(3, 3), kAnObstacle}};
  expectVerdicts(rows);
  expectVerdicts(rows, {}, false);
  expectVerdicts({{"one view is whole", cut(2, 1), kAnObstacle}});
  MergerOptions patient;
  patient.min_views = 4;
  expectVerdicts({{"3 views", cut(3, 3), asRejected(Reason::kPiece, false)}}, patient);
}

TEST(Verdict, RejectsWhatIsRarelySeenAndAlwaysBehind) {
  const auto behind = [](int views) { return [=](Evidence& e) { e.views = views, e.always_behind = true; }; };
  const std::vector<Row> rows{{"9 views", behind(9), asRejected(Reason::kHidden)},
                              {"10 views", behind(10), kAnObstacle},
                              {"2 views", behind(2), asRejected(Reason::kHidden, false)},
                              {"not behind", [](Evidence& e) { e.views = 9; }, kAnObstacle}};
  expectVerdicts(rows);
  expectVerdicts(rows, {}, false);
}

TEST(Verdict, RejectsARoughFitOfFewViews) {
  const auto rough = [](int views, double rms_m) {
    return [=](Evidence& e) {
      e.views = views;
      e.rms_m = rms_m;
    };
  };
  expectVerdicts({{"19 views", rough(19, 0.0151), asRejected(Reason::kRough)},
                  {"20 views", rough(20, 0.0151), kAnObstacle},
                  {"rms at the limit", rough(19, 0.015), kAnObstacle}});
  MergerOptions loose;
  loose.seldom_rms_m = 0.02;
  expectVerdicts({{"19 views", rough(19, 0.0151), kAnObstacle}}, loose);
}

TEST(Verdict, IsAFloorMarkingWhereCertainlyFlat) {
  const Expected marking{Decision::kFloorMarking, Reason::kFlat, true, 0, true};
  const Expected flat{Decision::kRejected, Reason::kFlat, true, 0, true};
  const Expected flat_unreported{Decision::kRejected, Reason::kFlat, false, 0, true};
  const auto low = [](double height_m, double spread, int floor_after) {
    return [=](Evidence& e) {
      e.height_m = height_m;
      e.spread = spread;
      e.floor_after = floor_after;
    };
  };
  expectVerdicts({{"certain", low(0.01, 0.5, 0), marking},
                  {"certain, floor seen", low(0.01, 0.5, 3), marking},
                  {"views disagree", low(0.01, 1.2, 0), flat},
                  {"views disagree, floor seen", low(0.01, 1.2, 3), flat_unreported},
                  {"9 views", [](Evidence& e) { e.height_m = 0.01, e.views = 9; }, flat},
                  {"height unknown", [](Evidence& e) { e.height_m = e.height_sigma_m = 0.0; }, kAnObstacle},
                  {"3 cm", low(0.03, 0.5, 0), kAnObstacle}});
  // Height and σ together must stay below the limit. Sums of powers of two are exact.
  MergerOptions options;
  options.flat_m = 0.1875;
  const auto high = [](double height_m) {
    return [=](Evidence& e) { e.height_m = height_m, e.height_sigma_m = 0.0625; };
  };
  expectVerdicts({{"at flat_m", high(0.125), kAnObstacle}, {"below flat_m", high(0.12), marking}}, options);
}

TEST(Verdict, RejectsALowPatternMissedAsOftenAsSeen) {
  const auto low = [](double height_m, double spread, int missed_by_walls, int floor_ever) {
    return [=](Evidence& e) {
      e.height_m = height_m;
      e.spread = spread;
      e.missed_by_walls = missed_by_walls;
      e.floor_ever = floor_ever;
    };
  };
  expectVerdicts({{"missed", low(0.05, 1.2, 40, 0), asRejected(Reason::kPattern)},
                  {"floor seen", low(0.05, 1.2, 0, 40), asRejected(Reason::kPattern)},
                  {"less often", low(0.05, 1.2, 39, 39), kAnObstacle},
                  {"certain", low(0.05, 1.0, 40, 40), kAnObstacle},
                  {"10 cm", low(0.1, 1.2, 40, 40), kAnObstacle}});
}

TEST(Verdict, RejectsWhatIsGone) {
  // Never missed before: three contributions that saw the floor suffice. What is surely upright needs four
  // times as many as rays that ended there.
  const auto after = [](int floor_after, int ended_after, double height_sigma_m) {
    return [=](Evidence& e) {
      e.floor_after = floor_after;
      e.ended_after = ended_after;
      e.height_sigma_m = height_sigma_m;
    };
  };
  expectVerdicts({{"twice", after(2, 0, 0.0), kAnObstacle},
                  {"three times", after(3, 0, 0.0), asRejected(Reason::kFloorSeen)},
                  {"upright, three times", after(3, 0, 0.002), withQuality(kLow)},
                  {"upright, four times", after(4, 0, 0.002), asRejected(Reason::kFloorSeen)},
                  {"upright, a ray ended there", after(7, 1, 0.002), withQuality(kLow)},
                  {"upright, eight times", after(8, 1, 0.002), asRejected(Reason::kFloorSeen)}});
  // Missed in half of the contributions before: as unlikely as three clear misses are 3·ln 0.1 / ln 0.5 = 10.
  const auto often_missed = [](int floor_after) {
    return [=](Evidence& e) { e.floor_before = 40, e.floor_after = floor_after, e.height_sigma_m = 0.0; };
  };
  expectVerdicts({{"9 misses", often_missed(9), kAnObstacle},
                  {"10 misses", often_missed(10), asRejected(Reason::kFloorSeen)}});
}

TEST(Verdict, RejectsWhatWasNeverThere) {
  const auto uncertain = [](const std::function<void(Evidence&)>& change) {
    return [=](Evidence& e) {
      e.spread = 1.2;
      e.height_sigma_m = 0.0;
      change(e);
    };
  };
  const auto few = [](const std::function<void(Evidence&)>& change) {
    return [=](Evidence& e) {
      e.views = 9;
      e.sigma_m = 0.006;
      e.height_sigma_m = 0.0;
      change(e);
    };
  };
  const Expected gone = asRejected(Reason::kFloorSeen);
  expectVerdicts(
      {{"floor from near", uncertain([](Evidence& e) { e.floor_before = 40; }), gone},
       {"less often", uncertain([](Evidence& e) { e.floor_before = 39; }), kAnObstacle},
       {"floor from anywhere", uncertain([](Evidence& e) { e.floor_since_first = 160; }), gone},
       {"fewer than 4 times", uncertain([](Evidence& e) { e.floor_since_first = 159; }), kAnObstacle},
       {"certain", [](Evidence& e) { e.floor_before = 40, e.height_sigma_m = 0.0; }, kAnObstacle},
       {"upright", [](Evidence& e) { e.floor_before = 40, e.spread = 1.2; }, withQuality(kLow)},
       {"few views, floor ever", few([](Evidence& e) { e.floor_ever = 9; }), gone},
       {"few views, floor less often", few([](Evidence& e) { e.floor_ever = 8; }), kAnObstacle},
       {"few views, missed", few([](Evidence& e) { e.missed = 36; }), gone},
       {"few views, missed less often", few([](Evidence& e) { e.missed = 35; }), kAnObstacle},
       {"few views, sharp", few([](Evidence& e) { e.floor_ever = 9, e.sigma_m = 0.005; }), kAnObstacle}});
}

TEST(Verdict, RejectsATopFaceOnTheFloor) {
  const auto top = [](int floor_after, bool was_driven_at) {
    return [=](Evidence& e) {
      e.is_top_face = true;
      e.floor_after = floor_after;
      e.was_driven_at = was_driven_at;
    };
  };
  expectVerdicts({{"floor at its sides", top(159, false), withQuality(kLow)},
                  {"floor 4 times as often", top(160, false), asRejected(Reason::kFloorSeen)},
                  {"a robot drove there", top(0, true), asRejected(Reason::kFloorSeen)},
                  {"not only a top face", [](Evidence& e) { e.was_driven_at = true; }, kAnObstacle}});
}

TEST(Verdict, ReportsOnlyWhatMayStandThereDespiteTheFloor) {
  const auto shapeless = [](int views, int floor_before, int floor_since_first, double height_sigma_m) {
    return [=](Evidence& e) {
      e.has_shape = false;
      e.views = views;
      e.floor_before = floor_before;
      e.floor_since_first = floor_since_first;
      e.height_sigma_m = height_sigma_m;
    };
  };
  const auto tall = [](double height_m) {
    return [=](Evidence& e) {
      e.has_shape = false;
      e.floor_before = 40;
      e.height_m = height_m;
    };
  };
  expectVerdicts({{"tall", shapeless(40, 40, 0, 0.002), asRejected(Reason::kTopFaceOnly)},
                  {"height unknown", shapeless(40, 40, 0, 0.0), asRejected(Reason::kNoShape, false)},
                  {"3 σ above 8 cm", tall(0.0861), asRejected(Reason::kTopFaceOnly)},
                  {"not 3 σ above 8 cm", tall(0.0859), asRejected(Reason::kNoShape, false)},
                  {"floor from afar", shapeless(40, 0, 160, 0.002), asRejected(Reason::kFloorSeen)},
                  {"9 views", shapeless(9, 9, 0, 0.002), asRejected(Reason::kNoShape, false)}});
}

TEST(Verdict, IsStructureWhereTheOutlineContinues) {
  const auto alone = [](double share) { return [=](Evidence& e) { e.alone = share; }; };
  expectVerdicts(
      {{"attached", alone(0.499), asStructure(Reason::kAttached)}, {"alone", alone(0.5), kAnObstacle}});
  MergerOptions loose;
  loose.least_alone = 0.3;
  expectVerdicts(
      {{"attached", alone(0.299), asStructure(Reason::kAttached)}, {"alone", alone(0.499), kAnObstacle}},
      loose);
}

TEST(Verdict, IsStructureWhereAnOutlineWithoutTopIsOpen) {
  const auto open = [](int cut_views, double seen, bool from_camera = true) {
    return [=](Evidence& e) {
      e.cut_views = cut_views;
      e.seen = seen;
      e.from_camera = from_camera;
    };
  };
  const Expected structure = asStructure(Reason::kOpenOutline);
  expectVerdicts({{"open", open(33, 0.749), structure},
                  {"seen", open(33, 0.75), kAnObstacle},
                  {"top seen in 20 % of the views", open(32, 0.749), kAnObstacle},
                  {"of a laser", open(33, 0.749, false), kAnObstacle}});
  MergerOptions loose;
  loose.least_seen = 0.5;
  expectVerdicts({{"open", open(33, 0.499), structure}, {"seen", open(33, 0.749), kAnObstacle}}, loose);
}

TEST(Verdict, DecidesAThinOutlineByTheSidesThatFacedACamera) {
  const auto thin = [](double faced, int cut_views, double spread) {
    return [=](Evidence& e) {
      e.is_thin = true;
      e.faced = faced;
      e.cut_views = cut_views;
      e.spread = spread;
    };
  };
  const Expected structure = asStructure(Reason::kOpenOutline);
  expectVerdicts({{"thin", thin(1.0, 0, 0.5), withQuality(kSliver)},
                  {"one side, top unseen", thin(0.749, 33, 0.5), structure},
                  {"both sides, top unseen", thin(0.75, 33, 0.5), withQuality(kSliver)},
                  {"one side, top seen", thin(0.5, 0, 0.5), withQuality(kSliver)},
                  {"one side, views disagree", thin(0.749, 0, 1.6), structure},
                  {"both sides, views disagree", thin(0.75, 0, 1.6), withQuality(kSliver | kDisagree)},
                  {"not thin, one side", [](Evidence& e) { e.faced = 0.5, e.cut_views = 33; }, kAnObstacle}});
}

TEST(Verdict, StatesWhatIsUncertainAboutAnObstacle) {
  const auto views = [](double spread, int flawed_views) {
    return [=](Evidence& e) { e.spread = spread, e.flawed_views = flawed_views; };
  };
  expectVerdicts({{"views agree", views(1.5, 0), kAnObstacle},
                  {"views disagree", views(1.51, 0), withQuality(kDisagree)},
                  {"hardly ever alone", views(0.71, 32), withQuality(kDisagree)},
                  {"hardly ever alone, agree", views(0.7, 32), kAnObstacle},
                  {"at times alone", views(0.71, 31), kAnObstacle},
                  {"of a laser", [](Evidence& e) { e.spread = 2.0, e.from_camera = false; }, kAnObstacle}});
  Evidence e = clearObstacle();
  e.floor_after = 3;
  e.is_thin = true;
  EXPECT_EQ(qualityOf(verdictOf(e, {}, true)), (std::vector<std::string>{"low_contrast", "thin"}));
  EXPECT_TRUE(qualityOf(verdictOf(clearObstacle(), {}, true)).empty());
}

TEST(Verdict, UsesOnlyShapeHeightAndLaterFloorForTheOverlayOfHulls) {
  MergerOptions hull;
  hull.method = "hull";
  expectVerdicts({{"attached", [](Evidence& e) { e.alone = 0.1; }, kAnObstacle},
                  {"open", [](Evidence& e) { e.seen = 0.0, e.cut_views = 40; }, kAnObstacle},
                  {"behind", [](Evidence& e) { e.views = 9, e.always_behind = true; }, kAnObstacle},
                  {"piece", [](Evidence& e) { e.views = e.cut_views = 2; }, kAnObstacle},
                  {"rough", [](Evidence& e) { e.views = 19, e.rms_m = 0.03; }, kAnObstacle},
                  {"views disagree", [](Evidence& e) { e.spread = 2.0; }, kAnObstacle},
                  {"floor before", [](Evidence& e) { e.spread = 1.2, e.floor_before = 40; }, kAnObstacle},
                  {"gone", [](Evidence& e) { e.floor_after = 3; }, asRejected(Reason::kFloorSeen)},
                  {"no shape", [](Evidence& e) { e.has_shape = false; }, asRejected(Reason::kNoShape)}},
                 hull);
}

TEST(Verdict, HasOneCodePerReason) {
  std::set<std::string> codes;
  for (int i = 0; i <= static_cast<int>(Reason::kPossibleMirror); ++i)
    codes.insert(toString(static_cast<Reason>(i)));
  EXPECT_EQ(codes.size(), static_cast<std::size_t>(Reason::kPossibleMirror) + 1);
  for (const std::string& code : codes)
    EXPECT_EQ(code.find_first_not_of("abcdefghijklmnopqrstuvwxyz_"), std::string::npos) << code;
}

}  // namespace
}  // namespace omnifleet::global_merger
