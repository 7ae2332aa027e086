#include "common/fault_runs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::services {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

Message mismatch(const std::string& text) {
  return {ErrorCode::kImageSizeMismatch, text};
}

TEST(FaultRuns, ReportsRepeatedFaultOnceAndCountsFrames) {
  FaultRuns faults;
  const Message wide = mismatch("641×480"), small = mismatch("320×240");
  EXPECT_THAT(faults.add("", {}), IsEmpty());
  EXPECT_THAT(faults.add("a.png", wide), ElementsAre(mismatch("a.png: 641×480; frame rejected")));
  for (int i = 0; i < 20; ++i) EXPECT_THAT(faults.add("b.png", wide), IsEmpty());
  EXPECT_THAT(faults.add("c.png", small), ElementsAre(mismatch("21 consecutive frames rejected: 641×480"),
                                                      mismatch("c.png: 320×240; frame rejected")));
  EXPECT_THAT(faults.add("", {}), IsEmpty()) << "a single frame needs no count";
  EXPECT_THAT(faults.add("d.png", small), ElementsAre(mismatch("d.png: 320×240; frame rejected")))
      << "a new fault after a good frame";
  faults.add("e.png", small);
  EXPECT_THAT(faults.end(), ElementsAre(mismatch("2 consecutive frames rejected: 320×240")));
  EXPECT_THAT(faults.end(), IsEmpty());
}

}  // namespace
}  // namespace omnifleet::services
