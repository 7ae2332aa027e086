#include "dataset/frame_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>

#include "dataset/atomic_file.h"
#include "dataset/capture.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

cv::Mat picture(int width, int height, int brightness) {
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(brightness, 2 * brightness, 255 - brightness));
  cv::circle(image, {width / 2, height / 2}, height / 4, {10, 200, 30}, cv::FILLED);
  return image;
}

class Frames : public ::testing::Test {
 protected:
  void SetUp() override {
    cv::imwrite(folder_ / "good.png", picture(64, 48, 20));
    cv::imwrite(folder_ / "good.jpg", picture(64, 48, 60));
    cv::imwrite(folder_ / "large.png", picture(65, 48, 20));
    writeAtomic(folder_ / "empty.png", "");
    writeAtomic(folder_ / "text.png", "this is no image");
    for (const char* name : {"good.png", "good.jpg"}) {
      const std::string bytes = readFile(folder_ / name);
      writeAtomic(folder_ / (std::string("cut_") + name), bytes.substr(0, bytes.size() * 3 / 5));
    }
    stream_.name = "r1/fisheye";
    stream_.camera.image_width_px = 64;
    stream_.camera.image_height_px = 48;
  }
  void add(TimeNs time_ns, const std::string& name) {
    const auto sequence = static_cast<std::uint32_t>(stream_.rows.size());
    stream_.rows.push_back({time_ns, sequence, name.empty() ? "" : folder_ / name});
  }

  test::TempFolder folder_;
  ImageStream stream_;
};

TEST_F(Frames, ReturnsOneFramePerRowWithItsState) {
  const std::vector<std::pair<const char*, FrameState>> files{{"good.png", FrameState::kOk},
                                                              {"good.jpg", FrameState::kOk},
                                                              {"nowhere.png", FrameState::kMissing},
                                                              {"", FrameState::kMissing},
                                                              {"empty.png", FrameState::kEmpty},
                                                              {"text.png", FrameState::kUnreadable},
                                                              {"cut_good.png", FrameState::kUnreadable},
                                                              {"cut_good.jpg", FrameState::kUnreadable},
                                                              {"large.png", FrameState::kWrongSize},
                                                              {"good.png", FrameState::kOk}};
  for (std::size_t i = 0; i < files.size(); ++i) add(static_cast<TimeNs>(i) + 1, files[i].first);
  const auto source = openStream(stream_, Colour::kBgr);
  EXPECT_EQ(source->size(), files.size());
  cv::Mat image;
  FrameInfo info;
  for (std::size_t i = 0; i < files.size(); ++i) {
    ASSERT_TRUE(source->next(image, info));
    EXPECT_EQ(info.state, files[i].second)
        << files[i].first << ": " << toString(info.state) << " " << info.where << " " << info.fault;
    EXPECT_EQ(info.time_ns, static_cast<TimeNs>(i) + 1);
    EXPECT_EQ(info.sequence, i);
    EXPECT_EQ(info.fault.empty(), info.state == FrameState::kOk);
    EXPECT_EQ(image.size(), cv::Size(64, 48));
  }
  EXPECT_EQ(cv::norm(image, picture(64, 48, 20), cv::NORM_INF), 0.0) << "PNG is lossless";
  EXPECT_FALSE(source->next(image, info));
}

TEST_F(Frames, DecodesIntoMemoryOfCaller) {
  add(1, "good.png");
  add(2, "large.png");
  add(3, "good.jpg");
  std::vector<unsigned char> loan(64 * 48 * 3, 0);
  cv::Mat image(48, 64, CV_8UC3, loan.data());
  const auto source = openStream(stream_, Colour::kBgr);
  FrameInfo info;
  while (source->next(image, info)) EXPECT_EQ(image.data, loan.data()) << info.fault;
  const cv::Mat expected = cv::imread(folder_ / "good.jpg");
  EXPECT_EQ(std::vector<unsigned char>(expected.datastart, expected.dataend), loan);
}

TEST_F(Frames, ConvertsToGreyOnRequest) {
  add(1, "good.png");
  cv::Mat image;
  FrameInfo info;
  ASSERT_TRUE(openStream(stream_, Colour::kGrey)->next(image, info));
  EXPECT_EQ(image.type(), CV_8UC1);
  EXPECT_EQ(cv::norm(image, cv::imread(folder_ / "good.png", cv::IMREAD_GRAYSCALE), cv::NORM_INF), 0.0);
}

TEST_F(Frames, MarksTimeThatDoesNotAdvanceOutOfOrder) {
  for (const TimeNs time_ns : {10, 30, 30, 20, 40}) add(time_ns, "good.png");
  const auto source = openStream(stream_, Colour::kBgr);
  cv::Mat image;
  FrameInfo info;
  std::vector<FrameState> states;
  while (source->next(image, info)) states.push_back(info.state);
  const FrameState ok = FrameState::kOk, bad = FrameState::kOutOfOrder;
  EXPECT_THAT(states, ::testing::ElementsAre(ok, ok, bad, bad, ok));
}

TEST_F(Frames, SortsFolderAndTakesSizeOfFirstImage) {
  const auto source = openFolder(folder_.path(), Colour::kBgr, {}, 100, 7);
  cv::Mat image;
  FrameInfo info;
  std::vector<std::string> states;
  TimeNs expected = 7;
  while (source->next(image, info)) {
    EXPECT_EQ(info.time_ns, expected);
    expected += 100;
    states.emplace_back(toString(info.state));
  }
  // cut_good.jpg, cut_good.png, empty.png, good.jpg, good.png, large.png, text.png
  EXPECT_THAT(states, ::testing::ElementsAre("unreadable", "unreadable", "empty", "ok", "ok", "wrong size",
                                             "unreadable"));
}

TEST_F(Frames, NamesSourceThatCannotBeOpened) {
  const auto message = [](const auto& open) {
    try {
      open();
    } catch (const options::Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message([&] { openFolder(folder_ / "nowhere", Colour::kBgr, {}, 1); }), HasSubstr("nowhere"));
  std::filesystem::create_directory(folder_ / "bare");
  EXPECT_THAT(message([&] { openFolder(folder_ / "bare", Colour::kBgr, {}, 1); }),
              HasSubstr("contains no image"));
  EXPECT_THAT(message([&] { openVideo(folder_ / "text.png", Colour::kBgr, {}); }), HasSubstr("text.png"));
  EXPECT_THAT(message([&] { openVideo(folder_ / "none.avi", Colour::kBgr, {}); }), HasSubstr("none.avi"));
  std::string fault;
  EXPECT_EQ(makeCaptureDevice("/dev/video97", {})->open(fault), nullptr);
  EXPECT_THAT(fault, HasSubstr("/dev/video97 does not exist"));
}

/// A line of another program's library without source and time would stand in the log of a service.
TEST(Pipeline, IsRefusedWithTheReasonOfGStreamerAndNoOtherLine) {
  if (!cv::videoio_registry::hasBackend(cv::CAP_GSTREAMER)) GTEST_SKIP() << "OpenCV has no GStreamer";
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // as the launcher does
  std::string fault;
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(makeCaptureDevice("no_such_element ! appsink", {})->open(fault), nullptr);
  EXPECT_THAT(fault, AllOf(HasSubstr("the GStreamer pipeline cannot be opened: "),
                           HasSubstr("no element \"no_such_element\"")));
  EXPECT_EQ(makeCaptureDevice("fakesrc ! fakesink", {})->open(fault), nullptr);
  EXPECT_THAT(fault, HasSubstr("the GStreamer pipeline cannot be opened: "));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST_F(Frames, ReadsVideoAtItsOwnRate) {
  const std::string path = folder_ / "v.avi";
  cv::VideoWriter writer(path, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20.0, {64, 48});
  ASSERT_TRUE(writer.isOpened()) << "OpenCV has a built-in Motion JPEG writer";
  for (int i = 0; i < 5; ++i) writer.write(picture(64, 48, 20 * i));
  writer.release();
  const auto source = openVideo(path, Colour::kBgr, {}, 1000);
  cv::Mat image;
  FrameInfo info;
  int n = 0;
  for (; source->next(image, info); ++n) {
    EXPECT_EQ(info.state, FrameState::kOk) << info.fault;
    EXPECT_EQ(info.time_ns, 1000 + n * 50000000LL);
    // JPEG changes a flat colour by a few grey levels; frames differ by 20 to 40.
    const cv::Mat first = image.rowRange(0, 8), expected = picture(64, 48, 20 * n).rowRange(0, 8);
    EXPECT_LT(cv::norm(first, expected, cv::NORM_L1) / (first.total() * 3.0), 8.0);
  }
  EXPECT_EQ(n, 5);
  cv::Mat other;
  ASSERT_TRUE(openVideo(path, Colour::kGrey, {32, 32})->next(other, info));
  EXPECT_EQ(info.state, FrameState::kWrongSize);
}

/// An element of a Matroska file (EBML, RFC 8794): id, size in 8 bytes, content.
std::string element(const std::string& id, const std::string& content) {
  std::string size(8, '\x01');
  for (int i = 0; i < 7; ++i) size[7 - i] = static_cast<char>(content.size() >> (8 * i));
  return id + size + content;
}

std::string number(std::uint32_t value) {
  std::string bytes(4, '\0');
  for (int i = 0; i < 4; ++i) bytes[3 - i] = static_cast<char>(value >> (8 * i));
  return bytes;
}

/// A Matroska file of JPEG frames at any times (RFC 9559), written by hand: no writer of OpenCV makes one.
std::string matroska(const std::vector<int>& times_ms) {
  std::string blocks = element("\xE7", number(0));  // the cluster's time
  for (std::size_t i = 0; i < times_ms.size(); ++i) {
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", picture(64, 48, static_cast<int>(20 * i)), jpeg);
    std::string block = "\x81";  // track 1
    block += static_cast<char>(times_ms[i] >> 8);
    block += static_cast<char>(times_ms[i]);
    block += '\x80';  // key frame
    blocks += element("\xA3", block + std::string(jpeg.begin(), jpeg.end()));
  }
  const std::string size = element("\xE0", element("\xB0", number(64)) + element("\xBA", number(48)));
  const std::string track =
      element("\xAE", element("\xD7", number(1)) + element("\x73\xC5", number(1)) +
                          element("\x83", number(1)) + element("\x86", "V_MJPEG") + size);
  const std::string info = element("\x2A\xD7\xB1", number(1000000)) + element("\x4D\x80", "test") +
                           element("\x57\x41", "test");  // ticks of 1 ms
  return element("\x1A\x45\xDF\xA3", element("\x42\x82", "matroska") + element("\x42\x87", number(4)) +
                                         element("\x42\x85", number(2))) +
         element("\x18\x53\x80\x67", element("\x15\x49\xA9\x66", info) + element("\x16\x54\xAE\x6B", track) +
                                         element("\x1F\x43\xB6\x75", blocks));
}

TEST_F(Frames, UsesTimesOfVideoWithVariableRate) {
  writeAtomic(folder_ / "v.mkv", matroska({0, 100, 133, 9000, 9040}));
  const auto source = openVideo(folder_ / "v.mkv", Colour::kBgr, {}, 5);
  cv::Mat image;
  FrameInfo info;
  std::vector<TimeNs> times;
  while (source->next(image, info)) {
    EXPECT_EQ(info.state, FrameState::kOk) << info.fault;
    times.push_back(info.time_ns);
  }
  EXPECT_THAT(times, ::testing::ElementsAre(5, 100000005, 133000005, 9000000005, 9040000005));
  EXPECT_EQ(source->takeNotice(), "");
}

TEST_F(Frames, UsesAverageRateOfVideoFromTimeThatDoesNotFollow) {
  writeAtomic(folder_ / "v.mkv", matroska({0, 100, 200, 200, 150, 300}));
  const auto source = openVideo(folder_ / "v.mkv", Colour::kBgr, {});
  cv::Mat image;
  FrameInfo info;
  TimeNs latest_ns = -1;
  int frames = 0;
  for (; source->next(image, info); ++frames) {
    EXPECT_GT(info.time_ns, latest_ns) << frames;
    EXPECT_EQ(info.state, FrameState::kOk);
    latest_ns = info.time_ns;
  }
  EXPECT_EQ(frames, 6);
  EXPECT_THAT(source->takeNotice(), HasSubstr("v.mkv: frame 3 has no time after"));
  EXPECT_EQ(source->takeNotice(), "") << "once";
}

TEST(ExternalFrames, ReadsFolderAndVideo) {
  OMNIFLEET_NEEDS_DATA(folder, "fisheye_downward/real_table");
  OMNIFLEET_NEEDS_DATA(video, "overhead/vss/robot_move.mp4");
  cv::Mat image;
  FrameInfo info;
  const auto images = openFolder(folder, Colour::kBgr, {1920, 1080}, 100);
  ASSERT_EQ(images->size(), 8u);
  while (images->next(image, info)) EXPECT_EQ(info.state, FrameState::kOk) << info.fault;
  const auto movie = openVideo(video, Colour::kBgr, {632, 468});
  int n = 0;
  cv::Mat frame;
  while (movie->next(frame, info)) n += info.state == FrameState::kOk;
  EXPECT_EQ(n, 502);
}

}  // namespace
}  // namespace omnifleet::dataset
