#include "common/fault_runs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::services {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(FaultRuns, ACameraOfAnotherSizeIsToldOnceAndCounted) {
  FaultRuns faults;
  EXPECT_THAT(faults.add("", ""), IsEmpty());
  EXPECT_THAT(faults.add("a.png", "is 641×480"), ElementsAre("a.png: is 641×480"));
  for (int i = 0; i < 20; ++i) EXPECT_THAT(faults.add("b.png", "is 641×480"), IsEmpty());
  EXPECT_THAT(faults.add("c.png", "is 320×240"),
              ElementsAre("21 frames in a row: is 641×480", "c.png: is 320×240"));
  EXPECT_THAT(faults.add("", ""), IsEmpty()) << "one only";
  EXPECT_THAT(faults.add("d.png", "is 320×240"), ElementsAre("d.png: is 320×240")) << "again";
  faults.add("e.png", "is 320×240");
  EXPECT_THAT(faults.end(), ElementsAre("2 frames in a row: is 320×240"));
  EXPECT_THAT(faults.end(), IsEmpty());
}

}  // namespace
}  // namespace omnifleet::services
