#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>

#include "tunnel_pilot/can/embedded_bus.h"

// What the kernel, and others in the same folders, may do to the embedded bus.
namespace {

std::function<void(const std::string& path)> before_bind;
bool lstat_fails = false;
std::optional<uid_t> somebody;  // whom we are taken for

}  // namespace

// The library's calls of these come here first.
extern "C" int bind(int socket, const sockaddr* address, socklen_t length) noexcept {
  if (before_bind) before_bind(reinterpret_cast<const sockaddr_un*>(address)->sun_path);
  return static_cast<int>(syscall(SYS_bind, socket, address, length));
}
extern "C" int lstat(const char* path, struct stat* status) noexcept {
  if (!lstat_fails) return fstatat(AT_FDCWD, path, status, AT_SYMLINK_NOFOLLOW);
  errno = EACCES;
  return -1;
}
extern "C" uid_t geteuid() noexcept {
  return somebody ? *somebody : static_cast<uid_t>(syscall(SYS_geteuid));
}

namespace tunnel_pilot::can {
namespace {

namespace fs = std::filesystem;

Frame anyFrame() {
  Frame frame;
  frame.id = 0x110;
  frame.length = 8;
  return frame;
}

sockaddr_un localAddress(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  return address;
}

// A socket file of somebody else's.
int boundSocket(int type, const std::string& path) {
  const int socket_of_theirs = socket(AF_UNIX, type | SOCK_CLOEXEC, 0);
  const sockaddr_un address = localAddress(path);
  EXPECT_EQ(bind(socket_of_theirs, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  return socket_of_theirs;
}

class EmbeddedBusEdge : public testing::Test {
 protected:
  EmbeddedBusEdge() {
    const char* variable = std::getenv("XDG_RUNTIME_DIR");
    if (variable != nullptr) before_ = variable;
    char pattern[] = "/tmp/tunnel_pilot_edge.XXXXXX";
    own_ = mkdtemp(pattern);
    takeFor(own_);
  }
  ~EmbeddedBusEdge() override {
    before_bind = nullptr;
    lstat_fails = false;
    somebody.reset();
    before_ ? setenv("XDG_RUNTIME_DIR", before_->c_str(), 1) : unsetenv("XDG_RUNTIME_DIR");
    fs::remove_all(own_);
  }
  static void takeFor(const std::string& runtime) {
    setenv("XDG_RUNTIME_DIR", runtime.c_str(), 1);
    fs::create_directories(runtime);
  }
  std::string base() const { return own_ + "/tunnel_pilot_can"; }
  std::string folder() const { return base() + "/bus"; }

  static std::string whyRefused() {
    try {
      const EmbeddedBus bus("bus");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  static void expectRefused(const std::string& words) {
    const std::string why = whyRefused();
    EXPECT_NE(why.find(words), std::string::npos) << "'" << why << "'";
  }
  static auto descriptors() {
    return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
  }

  std::string own_;
  std::optional<std::string> before_;
};

TEST_F(EmbeddedBusEdge, WithoutARuntimeFolderOfItsUserItLivesInTmp) {
  const std::string tmp = "/tmp/tunnel_pilot_can." + std::to_string(geteuid());
  for (const char* runtime : {"", ".", "/no/such/folder"}) {
    setenv("XDG_RUNTIME_DIR", runtime, 1);
    EXPECT_EQ(EmbeddedBus("edge_test").folder(), tmp + "/edge_test") << runtime;
  }
  unsetenv("XDG_RUNTIME_DIR");
  EXPECT_EQ(EmbeddedBus("edge_test").folder(), tmp + "/edge_test");
  rmdir(tmp.c_str());  // refused while others use it
}

TEST_F(EmbeddedBusEdge, WhereNoFolderCanBeMadeItIsRefused) {
  setenv("XDG_RUNTIME_DIR", (own_ + "/file").c_str(), 1);
  std::ofstream(own_ + "/file") << "no folder";
  expectRefused("cannot make " + own_ + "/file/tunnel_pilot_can: Not a directory");
}

TEST_F(EmbeddedBusEdge, AFileOrALinkInThePlaceOfItsFolderIsRefused) {
  std::ofstream(base()) << "no folder";
  expectRefused(base() + " is not a folder of this user");
  fs::remove(base());
  fs::create_directory(own_ + "/elsewhere");
  fs::create_directory_symlink(own_ + "/elsewhere", base());
  expectRefused(base() + " is not a folder of this user");
}

TEST_F(EmbeddedBusEdge, AFolderOfSomebodyElseIsRefused) {
  fs::create_directory(base());
  somebody = geteuid() + 1;
  expectRefused(base() + " is not a folder of this user");
}

TEST_F(EmbeddedBusEdge, AFolderOfWhichNothingCanBeToldIsRefused) {
  fs::create_directory(base());
  lstat_fails = true;
  expectRefused(base() + " is not a folder of this user");
}

TEST_F(EmbeddedBusEdge, APathTooLongForASocketIsRefused) {
  takeFor(own_ + "/" + std::string(100, 'x'));
  expectRefused("is too long for a socket");
}

TEST_F(EmbeddedBusEdge, WithoutADescriptorLeftItIsRefused) {
  rlimit usual{};
  getrlimit(RLIMIT_NOFILE, &usual);
  const rlimit none{0, usual.rlim_max};
  setrlimit(RLIMIT_NOFILE, &none);
  const std::string why = whyRefused();
  setrlimit(RLIMIT_NOFILE, &usual);
  EXPECT_NE(why.find("socket: Too many open files"), std::string::npos) << why;
}

TEST_F(EmbeddedBusEdge, AFolderThatTheLastOneBeforeTookAlongIsMadeAnew) {
  int binds = 0;
  before_bind = [&](const std::string&) {
    if (++binds == 1) fs::remove_all(folder());
  };
  const EmbeddedBus bus("bus");
  EXPECT_EQ(bus.state(), BusState::kActive);
  EXPECT_EQ(binds, 2);
}

TEST_F(EmbeddedBusEdge, AFolderThatGoesAgainAndAgainIsRefusedInTheEnd) {
  before_bind = [&](const std::string&) { fs::remove_all(folder()); };
  const auto before = descriptors();
  expectRefused("cannot bind " + folder());
  EXPECT_EQ(descriptors(), before) << "its socket is closed";
}

TEST_F(EmbeddedBusEdge, AnAddressThatSomebodyTookIsRefusedAtOnce) {
  int binds = 0;
  before_bind = [&](const std::string& path) {
    ++binds;
    std::ofstream(path) << "taken";
  };
  expectRefused("Address already in use");
  EXPECT_EQ(binds, 1);
}

TEST_F(EmbeddedBusEdge, WhoComesRemovesTheSocketsOfTheDeadAlone) {
  const EmbeddedBus living("bus");
  close(boundSocket(SOCK_DGRAM, folder() + "/dead.sock"));
  const int stranger = boundSocket(SOCK_STREAM, folder() + "/stranger.sock");
  const EmbeddedBus next("bus");
  EXPECT_FALSE(fs::exists(folder() + "/dead.sock"));
  EXPECT_TRUE(fs::exists(folder() + "/stranger.sock"));
  EXPECT_EQ(living.state(), BusState::kActive);
  close(stranger);
}

TEST_F(EmbeddedBusEdge, ANameTooLongForASocketIsPassedOver) {
  EmbeddedBus first("bus");
  std::ofstream(folder() + "/" + std::string(120, 'x') + ".sock") << "";
  EmbeddedBus second("bus");
  EXPECT_TRUE(first.send(anyFrame()));
  EXPECT_TRUE(second.receive());
  EXPECT_EQ(first.dropped(), 0u);
}

TEST_F(EmbeddedBusEdge, WhoLeavesWhileItSendsIsNoLoss) {
  EmbeddedBus bus("bus");
  fs::create_symlink(folder() + "/left", folder() + "/leaves.sock");  // listed, and not there
  EXPECT_TRUE(bus.send(anyFrame()));
  EXPECT_EQ(bus.dropped(), 0u);
}

}  // namespace
}  // namespace tunnel_pilot::can
