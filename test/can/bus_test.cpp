#include <gtest/gtest.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include "tunnel_pilot/can/embedded_bus.h"
#include "tunnel_pilot/can/linux_frame.h"
#include "tunnel_pilot/can/log_writer.h"
#include "tunnel_pilot/can/memory_bus.h"

namespace tunnel_pilot::can {
namespace {

Frame makeFrame(std::uint32_t id, std::uint8_t first_byte = 0) {
  Frame frame;
  frame.id = id;
  frame.length = 8;
  frame.data[0] = first_byte;
  return frame;
}

// The buses of these tests live in a folder of their own, that goes when they are done.
class OwnRuntimeFolder : public testing::Environment {
 public:
  void SetUp() override {
    char pattern[] = "/tmp/tunnel_pilot_bus_test.XXXXXX";
    ASSERT_NE(mkdtemp(pattern), nullptr);
    folder_ = pattern;
    setenv("XDG_RUNTIME_DIR", pattern, 1);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

 private:
  std::string folder_;
};
const auto* const kOwnRuntimeFolder = testing::AddGlobalTestEnvironment(new OwnRuntimeFolder);

std::string uniqueName(const std::string& what) { return what + "_" + std::to_string(getpid()); }

TEST(MemoryBus, ReachesAllOthersInOrderAndNotTheSender) {
  MemoryBusHub hub;
  const auto a = hub.connect(), b = hub.connect(), c = hub.connect();
  a->send(makeFrame(1));
  b->send(makeFrame(2));
  for (Bus* bus : {c.get()}) {
    EXPECT_EQ(bus->receive()->id, 1u);
    EXPECT_EQ(bus->receive()->id, 2u);
    EXPECT_FALSE(bus->receive());
  }
  EXPECT_EQ(a->receive()->id, 2u);
  EXPECT_FALSE(a->receive());
}

TEST(MemoryBus, SendsNothingWhileDown) {
  MemoryBusHub hub;
  const auto a = hub.connect(), b = hub.connect();
  hub.setState(BusState::kDown);
  EXPECT_FALSE(a->send(makeFrame(1)));
  EXPECT_EQ(a->state(), BusState::kDown);
  hub.setState(BusState::kActive);
  EXPECT_FALSE(b->receive()) << "a frame of the past must not come late";
  EXPECT_EQ(a->confirmed(), 0u);
}

TEST(MemoryBus, LosesAndCountsWhatAFullQueueCannotHold) {
  MemoryBusHub hub;
  const auto a = hub.connect(), b = hub.connect();
  for (std::size_t i = 0; i < MemoryBusHub::kQueueLength + 3; ++i) a->send(makeFrame(1));
  EXPECT_EQ(hub.dropped(), 3u);
}

TEST(MemoryBus, ForgetsAParticipantThatLeft) {
  MemoryBusHub hub;
  const auto a = hub.connect();
  hub.connect();
  EXPECT_TRUE(a->send(makeFrame(1)));
}

TEST(MemoryBus, HasNothingToPoll) {
  MemoryBusHub hub;
  EXPECT_EQ(hub.connect()->descriptor(), -1);
}

TEST(LinuxFrame, OfElevenBitsWithALargerIdentifierIsNone) {
  can_frame frame{};
  frame.can_id = CAN_SFF_MASK;
  EXPECT_TRUE(fromLinux(frame));
  frame.can_id = CAN_SFF_MASK + 1;
  EXPECT_FALSE(fromLinux(frame));
  frame.can_id |= CAN_EFF_FLAG;
  EXPECT_TRUE(fromLinux(frame));
}

TEST(LogWriter, WritesWhatCandumpWritesWithEventsAmongIt) {
  std::ostringstream out;
  LogWriter log(out);
  log.event("start", fromSeconds(12.5));
  Frame frame = makeFrame(0x110, 0xAB);
  log.frame(frame, fromSeconds(12.5000019));
  frame.id = 0x0CFF1080;
  frame.extended = true;
  frame.length = 2;
  log.frame(frame, fromSeconds(1000.0));
  EXPECT_EQ(out.str(),
            "(12.500000) event start\n(12.500001) can0 110#AB00000000000000\n"
            "(1000.000000) can0 0CFF1080#AB00\n");
  frame.length = 15;  // which no frame has
  EXPECT_EQ(toText(frame), "0CFF1080#AB00000000000000");
}

TEST(EmbeddedBus, CarriesFramesUnchangedToAllOthers) {
  const std::string name = uniqueName("carry");
  EmbeddedBus a(name), b(name), c(name);
  Frame frame = makeFrame(0x1ABCDEF0 & CAN_EFF_MASK, 0x55);
  frame.extended = true;
  frame.length = 3;
  frame.data = {1, 2, 3, 0, 0, 0, 0, 0};
  EXPECT_TRUE(a.send(frame));
  for (EmbeddedBus* bus : {&b, &c}) {
    const auto got = bus->receive();
    ASSERT_TRUE(got);
    EXPECT_EQ(got->id, frame.id);
    EXPECT_TRUE(got->extended);
    EXPECT_EQ(got->length, 3);
    EXPECT_EQ(got->data, frame.data);
  }
  EXPECT_FALSE(a.receive());
}

TEST(EmbeddedBus, CrossesProcesses) {
  const std::string name = uniqueName("fork");
  EmbeddedBus here(name);
  const pid_t child = fork();
  if (child == 0) {
    EmbeddedBus there(name);
    there.send(makeFrame(0x123, 7));
    _exit(0);
  }
  pollfd wait{here.descriptor(), POLLIN, 0};
  ASSERT_EQ(poll(&wait, 1, 5000), 1);
  EXPECT_EQ(here.receive()->data[0], 7);
  waitpid(child, nullptr, 0);
}

TEST(EmbeddedBus, LeavesNoFolderBehind) {
  std::string folder;
  {
    EmbeddedBus a(uniqueName("gone"));
    folder = a.folder();
    { EmbeddedBus b(uniqueName("gone")); }
    EXPECT_TRUE(std::filesystem::exists(folder)) << "one is still there";
  }
  EXPECT_FALSE(std::filesystem::exists(folder));
  EmbeddedBus again(uniqueName("gone"));
  EXPECT_TRUE(std::filesystem::exists(folder));
}

TEST(EmbeddedBus, TwoNamesAreTwoBuses) {
  EmbeddedBus a(uniqueName("one")), b(uniqueName("two"));
  a.send(makeFrame(1));
  EXPECT_FALSE(b.receive());
}

TEST(EmbeddedBus, FullReceiverLosesFramesAndIsCounted) {
  const std::string name = uniqueName("full");
  EmbeddedBus a(name), lazy(name);
  constexpr int kSent = 5000;
  for (int i = 0; i < kSent; ++i) EXPECT_TRUE(a.send(makeFrame(1)));
  std::uint64_t received = 0;
  while (lazy.receive()) ++received;
  EXPECT_GT(a.dropped(), 0u);
  EXPECT_EQ(received + a.dropped(), static_cast<std::uint64_t>(kSent));
}

TEST(EmbeddedBus, RemovesSocketsOfDeadProcesses) {
  const std::string name = uniqueName("stale");
  EmbeddedBus here(name);
  const pid_t child = fork();
  if (child == 0) {
    new EmbeddedBus(name);  // dies with its socket file left behind
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  const auto count = [&] {
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(here.folder())) files += entry.exists();
    return files;
  };
  ASSERT_EQ(count(), 2u);
  here.send(makeFrame(1));
  EXPECT_EQ(count(), 1u);
  EXPECT_EQ(here.dropped(), 0u);
}

TEST(EmbeddedBus, DiscardsDatagramsThatAreNoDataFrame) {
  const std::string name = uniqueName("odd");
  EmbeddedBus here(name);
  const std::string path = std::filesystem::directory_iterator(here.folder())->path();
  const int rogue = socket(AF_UNIX, SOCK_DGRAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  const auto sendBytes = [&](const void* bytes, std::size_t count) {
    sendto(rogue, bytes, count, 0, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  };
  can_frame frame{};
  sendBytes(&frame, 15);
  sendBytes("", 0);
  frame.can_dlc = 9;
  sendBytes(&frame, sizeof(frame));
  frame.can_dlc = 8;
  frame.can_id = CAN_RTR_FLAG | 0x110;
  sendBytes(&frame, sizeof(frame));
  frame.can_id = CAN_ERR_FLAG;
  sendBytes(&frame, sizeof(frame));
  EXPECT_FALSE(here.receive());
  EXPECT_EQ(here.malformed(), 5u);
  frame.can_id = 0x110;
  sendBytes(&frame, sizeof(frame));
  EXPECT_TRUE(here.receive());
  close(rogue);
}

// The program printed in docs/can.md, as it stands there.
std::string documentedListener(const std::string& bus_name) {
  std::ifstream file(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/docs/can.md");
  std::ostringstream text;
  text << file.rdbuf();
  const std::string document = text.str();
  const std::size_t begin = document.find("```python\n") + 10;
  std::string program = document.substr(begin, document.find("```", begin) - begin);
  for (std::size_t at; (at = program.find("NAME")) != std::string::npos;)
    program.replace(at, 4, bus_name);
  return program;
}

TEST(EmbeddedBus, IsHeardByTheListenerOfTheDocument) {
  const std::string name = uniqueName("python");
  EmbeddedBus here(name);
  const std::string script = here.folder() + "/listener.py";
  std::ofstream(script) << documentedListener(name);
  FILE* listener = popen(("timeout 20 python3 " + script).c_str(), "r");
  ASSERT_NE(listener, nullptr);
  const auto participants = [&] {
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(here.folder())) {
      count += entry.path().extension() == ".sock" ? 1 : 0;
    }
    return count;
  };
  for (int i = 0; i < 1000 && participants() < 2; ++i) usleep(10000);
  Frame frame = makeFrame(0x120, 0xAB);
  frame.length = 3;
  here.send(frame);
  char line[64] = "";
  EXPECT_NE(fgets(line, sizeof(line), listener), nullptr);
  EXPECT_STREQ(line, "120 ab0000\n");
  for (const auto& entry : std::filesystem::directory_iterator(here.folder())) {
    const std::string file = entry.path().filename();
    if (file.rfind("listener-", 0) == 0 && entry.path().extension() == ".sock") {
      kill(std::stoi(file.substr(9)), SIGTERM);
    }
  }
  pclose(listener);
}

TEST(EmbeddedBus, TellsWhenItsSocketWasRemoved) {
  EmbeddedBus here(uniqueName("removed"));
  EXPECT_EQ(here.state(), BusState::kActive);
  std::filesystem::remove_all(here.folder());
  EXPECT_EQ(here.state(), BusState::kDown);
  EXPECT_FALSE(here.send(makeFrame(1)));
}

TEST(EmbeddedBus, RefusesNamesThatCouldLeaveItsFolder) {
  for (const char* name : {"", "a/b", "..", "a b", "123456789012345678901234567890123"}) {
    EXPECT_THROW(EmbeddedBus bus(name), std::invalid_argument) << name;
  }
}

}  // namespace
}  // namespace tunnel_pilot::can
