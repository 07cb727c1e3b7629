// The rviz plugins: loaded by rviz, their topics, their buttons, what is seen of them.
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <rviz/config.h>
#include <rviz/display_group.h>
#include <rviz/visualization_frame.h>
#include <rviz/visualization_manager.h>
#include <rviz/yaml_config_reader.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>

#include <QApplication>
#include <QDir>
#include <QFileInfo>
#include <QImage>
#include <QLabel>
#include <QLineEdit>
#include <QProcess>
#include <QPushButton>
#include <QScreen>
#include <QTemporaryDir>
#include <QtTest/QTest>
#include <algorithm>
#include <atomic>
#include <functional>
#include <map>

#include "tunnel_pilot/rviz/hud_display.h"
#include "tunnel_pilot/rviz/panel.h"

namespace tunnel_pilot::hud {
namespace {

constexpr double kPatience = 60.0;  // [s] a busy machine's
const QString kFile = QString(TUNNEL_PILOT_SOURCE_DIR) + "/rviz/hud.rviz";

// Serves the GUI until `done`. Returns done().
bool waitUntil(const std::function<bool()>& done, double seconds = kPatience) {
  const auto end = ros::SteadyTime::now() + ros::WallDuration(seconds);
  while (!done() && ros::SteadyTime::now() < end) {
    QCoreApplication::processEvents(QEventLoop::AllEvents, 20);
    ros::WallDuration(0.005).sleep();
  }
  return done();
}

/// A std_srvs/Trigger service that answers from threads of its own.
class FakeService {
 public:
  explicit FakeService(const std::string& name, bool success = true, const std::string& message = "") {
    node_.setCallbackQueue(&queue_);
    answer_.success = success;
    answer_.message = message;
    service_ = node_.advertiseService<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
        name, [this](auto&, auto& response) {
          ++calls;
          while (hangs && ros::ok()) ros::WallDuration(0.005).sleep();
          response = answer_;
          return true;
        });
    spinner_.start();
  }

  std::atomic<int> calls{0};
  std::atomic<bool> hangs{false};

 private:
  ros::NodeHandle node_;
  ros::CallbackQueue queue_;
  ros::AsyncSpinner spinner_{1, &queue_};
  std_srvs::Trigger::Response answer_;
  ros::ServiceServer service_;
};

class PanelTest : public ::testing::Test {
 protected:
  PanelTest() {
    panel_.show();
    QCoreApplication::processEvents();
  }

  void click(const char* button) {
    auto* widget = panel_.findChild<QPushButton*>(button);
    ASSERT_NE(nullptr, widget) << button;
    QTest::mouseClick(widget, Qt::LeftButton);
  }
  std::string text(const char* label) { return panel_.findChild<QLabel*>(label)->text().toStdString(); }
  bool says(const char* label, const std::string& words) {
    return waitUntil([&] { return text(label).find(words) != std::string::npos; });
  }

  Panel panel_;
};

class PanelButtonTest : public PanelTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(PanelButtonTest, CallsItsServiceOnceAndShowsTheAnswer) {
  FakeService service(GetParam(), true, "as you wish");
  click(GetParam());
  EXPECT_TRUE(says("answer", std::string(GetParam()) + ": accepted, as you wish")) << text("answer");
  EXPECT_EQ(1, service.calls);
}

INSTANTIATE_TEST_SUITE_P(Edges, PanelButtonTest,
                         ::testing::Values("engage", "release", "stop", "reset",
                                           "arbiter/use/lidar_driver", "arbiter/use/preview_driver"),
                         [](const auto& edge) {
                           std::string name = edge.param;
                           std::replace(name.begin(), name.end(), '/', '_');
                           return name;
                         });

TEST_F(PanelTest, TellsWhyAServiceRefuses) {
  FakeService service("engage", false, "no lidar scan");
  click("engage");
  EXPECT_TRUE(says("answer", "engage: refused, no lidar scan")) << text("answer");
}

TEST_F(PanelTest, TellsThatAServiceIsMissing) {
  click("release");
  EXPECT_TRUE(says("answer", "nobody offers the service release")) << text("answer");
}

TEST_F(PanelTest, StopsATruckWithoutTheBridge) {
  FakeService service("arbiter/stop");
  click("stop");
  EXPECT_TRUE(says("answer", "arbiter/stop: accepted")) << text("answer");
}

TEST_F(PanelTest, StopDoesNotWaitForACallThatHangs) {
  FakeService engage("engage"), stop("stop");
  engage.hangs = true;
  click("engage");
  ASSERT_TRUE(waitUntil([&] { return engage.calls == 1; }));
  click("stop");
  EXPECT_TRUE(says("answer", "stop: accepted")) << text("answer");
  engage.hangs = false;
  EXPECT_TRUE(says("answer", "engage: accepted")) << text("answer");
}

TEST_F(PanelTest, MayGoWhileACallHangs) {
  FakeService engage("engage");
  engage.hangs = true;
  {
    Panel panel;
    QTest::mouseClick(panel.findChild<QPushButton*>("engage"), Qt::LeftButton);
    ASSERT_TRUE(waitUntil([&] { return engage.calls == 1; }));
  }
  engage.hangs = false;
  click("engage");
  EXPECT_TRUE(says("answer", "engage: accepted"));
}

TEST_F(PanelTest, KeepsFolderAndTopicsInTheConfiguration) {
  rviz::Config config;
  config.mapSetValue("Record Folder", "/somewhere/else");
  config.mapSetValue("Record Topics", "scan my_topic");
  panel_.load(config);
  EXPECT_EQ("/somewhere/else", panel_.findChild<QLineEdit*>("folder")->text().toStdString());
  rviz::Config saved;
  panel_.save(saved);
  QString folder, topics;
  EXPECT_TRUE(saved.mapGetString("Record Folder", &folder));
  EXPECT_TRUE(saved.mapGetString("Record Topics", &topics));
  EXPECT_EQ("/somewhere/else", folder.toStdString());
  EXPECT_EQ("scan my_topic", topics.toStdString());
}

TEST_F(PanelTest, RecordsWhatRecordLaunchRecords) {
  QProcess launch;
  launch.start("roslaunch",
               {"--args", "/recorder", "tunnel_pilot", "record.launch", "folder:=/nowhere"});
  ASSERT_TRUE(launch.waitForFinished());
  const QString command = QString(launch.readAllStandardOutput()).simplified();
  rviz::Config saved;
  panel_.save(saved);
  QString topics;
  ASSERT_TRUE(saved.mapGetString("Record Topics", &topics));
  EXPECT_TRUE(topics.startsWith("scan ")) << topics.toStdString();
  EXPECT_TRUE(command.contains("/nowhere/drive " + topics)) << command.toStdString();
}

class RecorderTest : public PanelTest {
 protected:
  RecorderTest() : scans_(node_.advertise<sensor_msgs::LaserScan>("scan", 10)) {
    panel_.findChild<QLineEdit*>("folder")->setText(path());
  }

  QString path() { return folder_.path() + "/bags"; }
  QFileInfoList bags() { return QDir(path()).entryInfoList(QDir::Files); }

  // Sends one message, larger than the recorder's chunks, and waits until it is on the disk.
  bool recordsOneScan() {
    constexpr int kChunk = 768 * 1024;
    if (!waitUntil([&] { return scans_.getNumSubscribers() > 0; })) return false;
    sensor_msgs::LaserScan scan;
    scan.ranges.resize(2 * kChunk / sizeof(float));
    scans_.publish(scan);
    return waitUntil([&] { return !bags().empty() && bags().first().size() > kChunk; });
  }

  QTemporaryDir folder_;
  ros::NodeHandle node_;
  ros::Publisher scans_;
};

TEST_F(RecorderTest, RecordsIntoABagThatIsClosedAndTold) {
  click("record");
  EXPECT_TRUE(says("recording", "recording " + path().toStdString()));
  ASSERT_TRUE(recordsOneScan());
  click("record");
  ASSERT_TRUE(says("recording", " MB)")) << text("recording");
  ASSERT_EQ(1, bags().size());
  const rosbag::Bag bag(bags().first().filePath().toStdString());
  EXPECT_EQ(1u, rosbag::View(bag, rosbag::TopicQuery("/scan")).size());
}

TEST_F(RecorderTest, ClosesTheBagWhenThePanelGoes) {
  {
    Panel panel;
    panel.findChild<QLineEdit*>("folder")->setText(path());
    QTest::mouseClick(panel.findChild<QPushButton*>("record"), Qt::LeftButton);
    ASSERT_TRUE(recordsOneScan());
  }
  ASSERT_EQ(1, bags().size());
  EXPECT_EQ("bag", bags().first().suffix().toStdString());
}

TEST_F(RecorderTest, TellsThatItCannotRecord) {
  panel_.findChild<QLineEdit*>("folder")->setText("/proc/nowhere");
  click("record");
  EXPECT_TRUE(says("recording", "cannot make the folder /proc/nowhere")) << text("recording");
  EXPECT_FALSE(panel_.findChild<QPushButton*>("record")->isChecked());
}

HudDisplay* findHud(rviz::VisualizationFrame& frame) {
  auto* displays = frame.getManager()->getRootDisplayGroup();
  for (int i = 0; i < displays->numDisplays(); ++i) {
    if (auto* hud = dynamic_cast<HudDisplay*>(displays->getDisplayAt(i))) return hud;
  }
  return nullptr;
}

bool subscribes(const std::string& topic) {
  ros::V_string topics;
  ros::this_node::getSubscribedTopics(topics);
  return std::count(topics.begin(), topics.end(), ros::names::resolve(topic)) > 0;
}

/// rviz within this process, with the shipped file; a process holds no second one.
class FrameTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    frame_ = new rviz::VisualizationFrame;
    frame_->setApp(qApp);
    frame_->setSplashPath("");
    frame_->initialize(kFile);
    frame_->show();
    QCoreApplication::processEvents();
  }
  static void TearDownTestSuite() { delete frame_; }

  static rviz::VisualizationFrame* frame_;
};
rviz::VisualizationFrame* FrameTest::frame_ = nullptr;

TEST_F(FrameTest, HoldsHudAndPanelWithItsTopicsAndLetsThemGo) {
  ASSERT_NE(nullptr, findHud(*frame_));
  EXPECT_NE(nullptr, frame_->findChild<Panel*>());
  const std::vector<std::string> topics{
      "tunnel_state", "arbiter_state", "truck_status",          "joint_states",
      "command",      "odom",          "lidar_driver/proposal", "preview_driver/proposal"};
  for (const auto& topic : topics) EXPECT_TRUE(subscribes(topic)) << topic;
  findHud(*frame_)->setEnabled(false);
  for (const auto& topic : topics) EXPECT_FALSE(subscribes(topic)) << topic;
}

TEST_F(FrameTest, OutlivesFiveReloads) {
  rviz::YamlConfigReader reader;
  for (int i = 0; i < 5; ++i) {
    rviz::Config config;
    reader.readFile(config, kFile);
    ASSERT_FALSE(reader.error());
    frame_->load(config);
    ASSERT_NE(nullptr, findHud(*frame_)) << i;
    const auto frames = frame_->getManager()->getFrameCount();
    ASSERT_TRUE(waitUntil([&] { return frame_->getManager()->getFrameCount() > frames + 2; })) << i;
  }
  EXPECT_TRUE(subscribes("arbiter_state"));
}

/// How many pixels of the screen have exactly this colour.
int pixels(const QColor& color) {
  const QImage screen =
      QGuiApplication::primaryScreen()->grabWindow(0).toImage().convertToFormat(QImage::Format_RGB32);
  int count = 0;
  for (int y = 0; y < screen.height(); ++y) {
    const auto* line = reinterpret_cast<const QRgb*>(screen.constScanLine(y));
    count += static_cast<int>(std::count(line, line + screen.width(), color.rgb()));
  }
  return count;
}

TEST(Rviz, ShowsTheStateInColourAndLogsNoError) {
  constexpr int kBadge = 1000;  // of the state's badge, less its letters
  const QColor red(232, 82, 74), green(66, 190, 120);
  ros::NodeHandle node;
  auto publisher = node.advertise<TruckStatus>("truck_status", 1);
  TruckStatus status;
  const auto seen = [&](std::uint8_t state, const QColor& color, const QColor& other) {
    return waitUntil([&] {
      status.state = state;
      status.header.stamp = ros::Time::now();
      publisher.publish(status);
      return pixels(color) > kBadge && pixels(other) < kBadge / 10;
    });
  };
  QProcess rviz;
  rviz.setProcessChannelMode(QProcess::MergedChannels);
  rviz.start("rosrun", {"rviz", "rviz", "--splash-screen", "", "-d", kFile});
  EXPECT_TRUE(seen(TruckStatus::STATE_STOPPED, red, green));
  EXPECT_TRUE(seen(TruckStatus::STATE_ACTIVE, green, red));
  EXPECT_TRUE(waitUntil([&] { return pixels(green) < kBadge / 10; })) << "silence looks like a drive";
  EXPECT_EQ(QProcess::Running, rviz.state());
  rviz.terminate();
  rviz.waitForFinished(5000);
  rviz.kill();
  rviz.waitForFinished();
  const std::string log = rviz.readAll().toStdString();
  EXPECT_EQ(std::string::npos, log.find("ERROR")) << log;
  EXPECT_EQ(std::string::npos, log.find("tunnel_pilot/")) << log;
}

}  // namespace
}  // namespace tunnel_pilot::hud

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "plugins_test", ros::init_options::NoSigintHandler);
  const ros::NodeHandle keep_alive;
  QApplication application(argc, argv);
  return RUN_ALL_TESTS();
}
