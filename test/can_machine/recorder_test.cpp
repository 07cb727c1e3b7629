// The recorder knows when its recording lacks frames, by the counts of the kernel.
#include "recorder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "rig.h"
#include "tunnel_pilot/can/can_socket.h"

namespace tunnel_pilot::bridge {
namespace {

class CanMachineRecorder : public testing::Test {
 protected:
  CanMachineRecorder() { cleanLinks(); }

  /// More than the controller has room for, unless somebody fetches them.
  static void say(int frames) {
    const auto other = can::openCanSocket("can1", "");
    ASSERT_EQ(other->open({}), 0);
    for (int i = 0; i < frames; ++i) {
      EXPECT_EQ(other->send(can::Frame()), 0);
      usleep(1000);
    }
  }
  static void wakeController() {
    setLink("can2", false);
    setLink("can2", true);
    say(1);  // until then the emulated one does not interrupt
  }

  Recorder recorder;
};

TEST_F(CanMachineRecorder, MissesNothing) {
  say(30);
  EXPECT_EQ(recorder.end(), "nothing");
}

TEST_F(CanMachineRecorder, KnowsOfADeafController) {
  hangController("can2");
  say(30);
  EXPECT_EQ(recorder.end(), "unheard");
  wakeController();
}

TEST_F(CanMachineRecorder, KnowsOfAnOverrun) {
  hangController("can2");
  say(30);
  wakeController();
  EXPECT_EQ(recorder.end(), "overrun");
}

}  // namespace
}  // namespace tunnel_pilot::bridge
