#include "bus/time_merger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace omnifleet::bus {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;
using Merger = TimeMerger<std::string>;

StreamSpec input(const std::string& robot, int rank = 0) {
  return {"input of " + robot, robot, rank, StreamRole::kInput, StreamMode::kLockstep, true};
}
StreamSpec with(StreamSpec spec, StreamRole role) {
  spec.role = role;
  return spec;
}
StreamSpec live(StreamSpec spec) {
  spec.mode = StreamMode::kLive;
  return spec;
}

std::vector<std::string> names(const std::vector<Merger::Item>& items) {
  std::vector<std::string> result;
  for (const auto& item : items) result.push_back(item.payload);
  return result;
}

/// All batches that are ready, one line each: "t: feedback | side | inputs".
std::vector<std::string> drain(Merger& merger) {
  std::vector<std::string> lines;
  Merger::Batch batch;
  while (merger.nextBatch(batch)) {
    std::string line = std::to_string(batch.time) + ":";
    for (const auto* part : {&batch.feedback, &batch.side, &batch.inputs}) {
      for (const auto& item : *part) line += " " + item.payload + "@" + std::to_string(item.time);
      line += part == &batch.inputs ? "" : " |";
    }
    lines.push_back(line);
  }
  return lines;
}

TEST(TimeMerger, SortsEqualTimesByRobotThenRank) {
  Merger merger;
  const int b1 = merger.addStream(input("r2", 1));
  const int a2 = merger.addStream(input("r1", 2));
  const int b0 = merger.addStream(input("r2", 0));
  const int a1 = merger.addStream(input("r1", 1));
  EXPECT_TRUE(merger.push(b1, 10, "r2/1"));
  EXPECT_TRUE(merger.push(a2, 10, "r1/2"));
  EXPECT_TRUE(merger.push(b0, 10, "r2/0"));
  Merger::Batch batch;
  EXPECT_FALSE(merger.nextBatch(batch)) << "r1/1 has not reached 10";
  EXPECT_TRUE(merger.push(a1, 10, "r1/1"));
  ASSERT_TRUE(merger.nextBatch(batch));
  EXPECT_EQ(batch.time, 10);
  EXPECT_THAT(names(batch.inputs), ElementsAre("r1/1", "r1/2", "r2/0", "r2/1"));
  EXPECT_FALSE(merger.nextBatch(batch));
}

TEST(TimeMerger, DoesNotWaitForGapInStream) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  const int b = merger.addStream(input("b"));
  merger.push(a, 1, "a1");
  merger.push(a, 2, "a2");
  merger.push(a, 3, "a3");
  EXPECT_THAT(drain(merger), IsEmpty());
  merger.push(b, 3, "b3");
  EXPECT_THAT(drain(merger), ElementsAre("1: | | a1@1", "2: | | a2@2", "3: | | a3@3 b3@3"));
}

TEST(TimeMerger, WaitsForStreamThatHasNotReachedTheTime) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  const int b = merger.addStream(input("b"));
  merger.push(a, 5, "a5");
  merger.push(b, 5, "b5");
  EXPECT_THAT(drain(merger), ElementsAre("5: | | a5@5 b5@5"));
  merger.push(a, 6, "a6");
  EXPECT_THAT(drain(merger), IsEmpty()) << "b may still have a sample at 6";
}

TEST(TimeMerger, WatermarkReleasesBatchAndRejectsEarlierSamples) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  const int b = merger.addStream(input("b"));
  merger.push(a, 5, "a5");
  merger.advance(b, 4);
  EXPECT_THAT(drain(merger), IsEmpty());
  merger.advance(b, 5);
  EXPECT_THAT(drain(merger), ElementsAre("5: | | a5@5"));
  EXPECT_FALSE(merger.push(b, 5, "late"));
  EXPECT_EQ(merger.rejected(b), 1u);
  merger.advance(b, 2);  // an earlier watermark has no effect
  EXPECT_FALSE(merger.push(b, 4, "late"));
  EXPECT_TRUE(merger.push(b, 6, "b6"));
}

TEST(TimeMerger, RejectsAndCountsSampleOutOfOrder) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  EXPECT_TRUE(merger.push(a, 7, "a7"));
  EXPECT_FALSE(merger.push(a, 7, "again"));
  EXPECT_FALSE(merger.push(a, 3, "past"));
  EXPECT_EQ(merger.rejected(a), 2u);
  EXPECT_THAT(drain(merger), ElementsAre("7: | | a7@7"));
}

TEST(TimeMerger, EndThatArrivesBeforeItsSamplesWaitsForThem) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  const int b = merger.addStream(input("b"));
  merger.push(a, 1, "a1");
  merger.push(a, 9, "a9");
  merger.end(b, 2);
  EXPECT_THAT(drain(merger), IsEmpty());
  merger.push(b, 2, "b2");
  EXPECT_THAT(drain(merger), ElementsAre("1: | | a1@1", "2: | | b2@2"))
      << "one sample of b has not arrived yet";
  merger.push(b, 3, "b3");
  EXPECT_THAT(drain(merger), ElementsAre("3: | | b3@3", "9: | | a9@9"));
  EXPECT_FALSE(merger.finished()) << "a has not ended";
  merger.end(a, 2);
  EXPECT_TRUE(merger.finished());
}

TEST(TimeMerger, CountsRejectedSampleAsArrived) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  merger.push(a, 1, "a1");
  merger.push(a, 1, "doubled");
  merger.end(a, 2);
  drain(merger);
  EXPECT_TRUE(merger.finished());
}

TEST(TimeMerger, EmptyStreamEndsAtOnce) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  const int b = merger.addStream(input("b"));
  merger.end(b, 0);
  merger.push(a, 1, "a1");
  EXPECT_THAT(drain(merger), ElementsAre("1: | | a1@1"));
  EXPECT_FALSE(merger.wants(b));
  EXPECT_TRUE(merger.wants(a));
}

TEST(TimeMerger, WaitsForFeedbackOfPreviousFrame) {
  Merger merger;
  const int a = merger.addStream(input("r1"));
  const int pose = merger.addStream(with(input("r1", 9), StreamRole::kFeedback));
  merger.push(a, 10, "a");
  merger.push(a, 20, "a");
  merger.push(a, 30, "a");
  EXPECT_THAT(drain(merger), ElementsAre("10: | | a@10")) << "the batch at 20 needs the pose at 10";
  merger.push(pose, 10, "p");
  EXPECT_THAT(drain(merger), ElementsAre("20: p@10 | | a@20"));
  merger.push(pose, 20, "p");
  merger.push(pose, 30, "p");
  EXPECT_THAT(drain(merger), ElementsAre("30: p@20 | | a@30"))
      << "the batch at 30 must not contain its own pose";
  merger.push(a, 40, "a");
  EXPECT_THAT(drain(merger), ElementsAre("40: p@30 | | a@40"));
}

TEST(TimeMerger, DoesNotWaitForFeedbackWithEndOrWatermark) {
  Merger merger;
  const int a = merger.addStream(input("r1"));
  const int pose = merger.addStream(with(input("r1"), StreamRole::kFeedback));
  const int state = merger.addStream(with(input("r2"), StreamRole::kFeedback));
  merger.push(a, 10, "a");
  merger.push(a, 20, "a");
  merger.end(state, 0);
  merger.advance(pose, 10);
  EXPECT_THAT(drain(merger), ElementsAre("10: | | a@10", "20: | | a@20"));
}

TEST(TimeMerger, PromiseCountsOnceItsLastSampleArrived) {
  Merger merger;
  const int a = merger.addStream(input("r1"));
  const int own = merger.addStream(with(input("r1"), StreamRole::kFeedback));
  const int other = merger.addStream(with(input("r2"), StreamRole::kFeedback));
  const int none = merger.addStream(with(input("r3"), StreamRole::kFeedback));
  merger.push(a, 10, "a");
  merger.push(a, 20, "a");
  EXPECT_THAT(drain(merger), ElementsAre("10: | | a@10"));
  merger.push(own, 10, "p1");
  merger.promise(none, INT64_MIN, 10);
  merger.promise(other, 7, 10);
  EXPECT_THAT(drain(merger), IsEmpty()) << "the pose of r2 at 7 has not arrived yet";
  merger.push(other, 7, "p2");
  EXPECT_THAT(drain(merger), ElementsAre("20: p2@7 p1@10 | | a@20"))
      << "the next pose of r2 is later than 10";
  EXPECT_TRUE(merger.push(other, 17, "p2"));
}

TEST(TimeMerger, NewerPromiseCountsInAnyOrderOfArrival) {
  Merger merger;
  const int a = merger.addStream(input("r1"));
  const int other = merger.addStream(with(input("r2"), StreamRole::kFeedback));
  for (const TimeNs t : {10, 20, 30}) merger.push(a, t, "a");
  merger.promise(other, 17, 20);
  merger.promise(other, 7, 10);
  merger.push(other, 7, "p");
  EXPECT_THAT(drain(merger), ElementsAre("10: | | a@10"));
  merger.push(other, 17, "p");
  EXPECT_THAT(drain(merger), ElementsAre("20: p@7 | | a@20", "30: p@17 | | a@30"));
}

TEST(TimeMerger, FeedbackFollowsPrimaryStreamOnly) {
  Merger merger;
  const int frame = merger.addStream(input("r1"));
  StreamSpec second = input("r2");
  second.primary = false;
  const int other = merger.addStream(second);
  const int pose = merger.addStream(with(input("r1"), StreamRole::kFeedback));
  merger.push(frame, 10, "f");
  merger.push(other, 11, "o");
  merger.push(frame, 20, "f");
  merger.push(other, 21, "o");
  EXPECT_THAT(drain(merger), ElementsAre("10: | | f@10"));
  merger.push(pose, 10, "p");
  EXPECT_THAT(drain(merger), ElementsAre("11: p@10 | | o@11", "20: | | f@20"))
      << "the batch at 20 needs only the pose at 10; the one at 21 needs the pose at 20";
}

TEST(TimeMerger, ReturnsSideRowsBeforeBatchAndWaitsForThem) {
  Merger merger;
  const int frame = merger.addStream(input("r1"));
  const int wheels = merger.addStream(with(input("r1", 1), StreamRole::kSide));
  merger.push(wheels, 1, "w");
  merger.push(wheels, 4, "w");
  merger.push(frame, 5, "f");
  EXPECT_THAT(drain(merger), IsEmpty()) << "another row before 5 may arrive";
  merger.push(wheels, 5, "w");
  EXPECT_THAT(drain(merger), ElementsAre("5: | w@1 w@4 | f@5")) << "the row at 5 is valid from 5 on";
  merger.push(frame, 7, "f");
  merger.end(wheels, 3);
  EXPECT_THAT(drain(merger), ElementsAre("7: | w@5 | f@7"));
  merger.end(frame, 2);
  EXPECT_TRUE(merger.finished());
}

TEST(TimeMerger, SideRowsAloneFormNoBatch) {
  Merger merger;
  merger.addStream(input("r1"));
  const int wheels = merger.addStream(with(input("r1", 1), StreamRole::kSide));
  for (int t = 1; t < 5; ++t) merger.push(wheels, t, "w");
  EXPECT_THAT(drain(merger), IsEmpty());
}

TEST(TimeMerger, LiveModeNeverWaitsAndSortsAvailableSamples) {
  Merger merger;
  const int a = merger.addStream(live(input("a")));
  const int b = merger.addStream(live(input("b")));
  const int pose = merger.addStream(live(with(input("a"), StreamRole::kFeedback)));
  merger.addStream(live(with(input("a"), StreamRole::kSide)));
  merger.push(b, 8, "b");
  EXPECT_THAT(drain(merger), ElementsAre("8: | | b@8"));
  merger.push(b, 9, "b");
  merger.push(a, 7, "a");
  merger.push(pose, 99, "p");
  EXPECT_THAT(drain(merger), ElementsAre("7: p@99 | | a@7", "9: | | b@9"));
  EXPECT_FALSE(merger.waitingFor({}));
  EXPECT_FALSE(merger.push(b, 9, "b")) << "times within a stream must increase in live mode too";
}

TEST(TimeMerger, DoesNotWaitForLiveStreamAmongLockstepStreams) {
  Merger merger;
  const int frames = merger.addStream(input("r1"));
  const int command = merger.addStream(live(input("operator")));
  merger.push(frames, 1, "f");
  EXPECT_THAT(drain(merger), ElementsAre("1: | | f@1"));
  merger.push(command, 3, "c");
  merger.push(frames, 4, "f");
  EXPECT_THAT(drain(merger), ElementsAre("3: | | c@3", "4: | | f@4"));
  merger.end(frames, 2);
  EXPECT_TRUE(merger.finished()) << "a live stream never ends";
}

TEST(TimeMerger, RequestsOneFrameAtATime) {
  Merger merger;
  const int camera = merger.addStream(input("r1"));
  const int other = merger.addStream(input("r2"));
  EXPECT_TRUE(merger.wants(camera));
  merger.push(camera, 1, "f");
  EXPECT_FALSE(merger.wants(camera));
  EXPECT_THAT(drain(merger), IsEmpty());
  EXPECT_FALSE(merger.wants(camera)) << "still queued";
  merger.push(other, 2, "f");
  drain(merger);
  EXPECT_TRUE(merger.wants(camera));
  merger.end(camera, 1);
  EXPECT_FALSE(merger.wants(camera));
}

TEST(TimeMerger, NamesSilentStreamAndDuration) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  const int b = merger.addStream(input("b"));
  const TimeOrder::Monotonic start{};
  merger.push(a, 1, "a1");
  auto waiting = merger.waitingFor(start);
  ASSERT_TRUE(waiting);
  EXPECT_EQ(waiting->stream, b);
  EXPECT_EQ(waiting->name, "input of b");
  EXPECT_EQ(waiting->silent, seconds(0));
  EXPECT_EQ(merger.waitingFor(start + seconds(12))->silent, seconds(12));
  merger.push(b, 0, "b0");  // it makes progress, although it is behind
  drain(merger);
  EXPECT_EQ(merger.waitingFor(start + seconds(13))->silent, seconds(0));
  EXPECT_EQ(merger.waitingFor(start + seconds(43))->silent, seconds(30));
  merger.push(b, 1, "b1");
  EXPECT_FALSE(merger.waitingFor(start + seconds(44))) << "a batch is ready: no stream blocks it";
}

TEST(TimeMerger, NamesStreamWithMissingLastSample) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  const int b = merger.addStream(input("b"));
  for (int t : {1, 2}) merger.push(a, t, "a");
  for (int t : {1, 2, 3}) merger.push(b, t, "b");
  merger.end(a, 3);
  merger.end(b, 3);
  EXPECT_EQ(drain(merger).size(), 2u);
  EXPECT_FALSE(merger.finished());
  EXPECT_EQ(merger.waitingFor({})->name, "input of a");
  merger.push(a, 3, "a");
  EXPECT_EQ(drain(merger).size(), 1u);
  EXPECT_TRUE(merger.finished());
  EXPECT_FALSE(merger.waitingFor({}));
}

TEST(TimeMerger, NamesMissingFeedbackAndSlowestOfSeveralStreams) {
  Merger merger;
  const int a = merger.addStream(input("a"));
  merger.addStream(with({"pose of a", "a"}, StreamRole::kFeedback));
  merger.push(a, 1, "a");
  merger.push(a, 2, "a");
  drain(merger);
  EXPECT_EQ(merger.waitingFor({})->name, "pose of a");

  Merger idle;
  const int fast = idle.addStream(input("fast"));
  idle.addStream(input("slow"));
  EXPECT_EQ(idle.waitingFor({})->name, "input of fast") << "both are silent, so the first is named";
  idle.advance(fast, 5);
  EXPECT_EQ(idle.waitingFor({})->name, "input of slow");
}

/// Random content of the streams of a stage, one per seed, which the test pushes in a random interleaving.
struct Recording {
  std::vector<StreamSpec> specs;
  std::vector<std::vector<TimeNs>> times;

  explicit Recording(std::mt19937& random) {
    for (const char* robot : {"r3", "r1", "r2"}) {
      add(input(robot, 0), random);
      add(input(robot, 1), random);
      add(with(input(robot, 2), StreamRole::kSide), random);
    }
    add(with(input("r1", 3), StreamRole::kFeedback), random);
  }
  void add(const StreamSpec& spec, std::mt19937& random) {
    specs.push_back(spec);
    std::vector<TimeNs> row;
    TimeNs t = 0;
    const int count = std::uniform_int_distribution<int>(0, 25)(random);
    for (int i = 0; i < count; ++i) row.push_back(t += std::uniform_int_distribution<int>(1, 4)(random));
    times.push_back(row);
  }
  /// The batches by definition: one per time at which an input has a sample, inputs sorted by (robot, rank).
  std::vector<std::string> expected() const {
    std::vector<TimeNs> all;
    for (std::size_t s = 0; s < specs.size(); ++s) {
      if (specs[s].role == StreamRole::kInput) all.insert(all.end(), times[s].begin(), times[s].end());
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    std::vector<std::string> lines;
    TimeNs previous = 0, before = 0;
    for (TimeNs t : all) {
      lines.push_back(std::to_string(t) + ":" + part(StreamRole::kFeedback, before, previous) + " |" +
                      part(StreamRole::kSide, previous, t - 1) + " |" + part(StreamRole::kInput, t, t));
      before = previous + 1;
      previous = t;
    }
    return lines;
  }
  std::string part(StreamRole role, TimeNs from, TimeNs to) const {
    std::vector<std::tuple<TimeNs, std::string, int>> found;
    for (std::size_t s = 0; s < specs.size(); ++s) {
      if (specs[s].role != role) continue;
      for (TimeNs t : times[s]) {
        if (from <= t && t <= to) found.emplace_back(t, specs[s].robot, specs[s].rank);
      }
    }
    std::sort(found.begin(), found.end());
    std::string text;
    for (const auto& [t, robot, rank] : found) {
      text += " " + robot + "/" + std::to_string(rank) + "@" + std::to_string(t);
    }
    return text;
  }
};

class Interleavings : public testing::TestWithParam<int> {};

TEST_P(Interleavings, GiveTheSameBatches) {
  std::mt19937 random(GetParam());
  const Recording recording(random);
  Merger merger;
  for (const auto& spec : recording.specs) merger.addStream(spec);
  const std::size_t streams = recording.specs.size();
  std::vector<std::size_t> next(streams, 0);
  std::vector<bool> ended(streams, false);
  std::vector<std::string> lines;
  while (std::count(ended.begin(), ended.end(), false) > 0 || next != [&] {
    std::vector<std::size_t> sizes;
    for (const auto& row : recording.times) sizes.push_back(row.size());
    return sizes;
  }()) {
    const std::size_t s = std::uniform_int_distribution<std::size_t>(0, streams - 1)(random);
    if (!ended[s] && std::uniform_int_distribution<int>(0, 20)(random) == 0) {
      merger.end(static_cast<int>(s),
                 recording.times[s].size());  // may arrive before samples, because run/end has its own writer
      ended[s] = true;
    } else if (next[s] < recording.times[s].size()) {
      const auto& spec = recording.specs[s];
      ASSERT_TRUE(merger.push(static_cast<int>(s), recording.times[s][next[s]++],
                              spec.robot + "/" + std::to_string(spec.rank)));
    }
    if (std::uniform_int_distribution<int>(0, 3)(random) == 0) {
      for (auto& line : drain(merger)) lines.push_back(line);
    }
  }
  for (auto& line : drain(merger)) lines.push_back(line);
  EXPECT_EQ(lines, recording.expected());
  EXPECT_TRUE(merger.finished());
}

INSTANTIATE_TEST_SUITE_P(Seeds, Interleavings, testing::Range(0, 60));

}  // namespace
}  // namespace omnifleet::bus
