#include "tunnel_pilot/bridge/operator_socket.h"

#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

bool peer_is_unknown = false;
bool stays_blocking = false;

int refused() {
  errno = EACCES;
  return -1;
}

}  // namespace

// The library's calls of these come here first.
extern "C" int getsockopt(int socket, int level, int name, void* value, socklen_t* size) noexcept {
  if (peer_is_unknown && name == SO_PEERCRED) return refused();
  return static_cast<int>(syscall(SYS_getsockopt, socket, level, name, value, size));
}
extern "C" int ioctl(int descriptor, unsigned long request, ...) noexcept {
  if (stays_blocking && request == FIONBIO) return refused();
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  return static_cast<int>(syscall(SYS_ioctl, descriptor, request, argument));
}

namespace tunnel_pilot::bridge {
namespace {

Stamp ms(int milliseconds) { return std::chrono::milliseconds(milliseconds); }

// Whoever connects: a client without any of our code.
class Client {
 public:
  explicit Client(const std::string& path) : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
    connected_ = connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~Client() { close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void say(const std::string& text) const { send(socket_, text.data(), text.size(), MSG_NOSIGNAL); }
  std::string answer() const {
    char bytes[256];
    const ssize_t count = recv(socket_, bytes, sizeof bytes, 0);
    return count > 0 ? std::string(bytes, static_cast<std::size_t>(count)) : "";
  }
  bool connected() const { return connected_; }

 private:
  int socket_;
  bool connected_ = false;
};

class OperatorSocketTest : public ::testing::Test {
 protected:
  OperatorSocketTest() : folder_(makeFolder()), path_(folder_ + "/operator.sock") {}
  ~OperatorSocketTest() override {
    std::filesystem::remove_all(folder_);
    peer_is_unknown = stays_blocking = false;
  }

  static std::string makeFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "operator_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder for the test");
    return name;
  }

  void poll(OperatorSocket& socket, Stamp now = ms(0)) {
    socket.poll(now, [this](OperatorSocket::Edge edge, unsigned user) {
      edges_.push_back(edge);
      user_ = user;
      return refusal_;
    });
  }

  std::string folder_, path_, refusal_;
  std::vector<OperatorSocket::Edge> edges_;
  unsigned user_ = 12345;
};

TEST_F(OperatorSocketTest, AnEdgeIsHandedOnWithItsUserAndAnswered) {
  OperatorSocket socket(path_);
  for (const auto edge : {OperatorSocket::Edge::kEngage, OperatorSocket::Edge::kRelease,
                          OperatorSocket::Edge::kStop, OperatorSocket::Edge::kReset}) {
    const Client client(path_);
    client.say(toString(edge) + "\n");
    poll(socket);
    EXPECT_EQ(client.answer(), "ok\n");
    EXPECT_EQ(edges_.back(), edge);
    EXPECT_EQ(user_, getuid());
  }
}

TEST_F(OperatorSocketTest, ARefusalSaysWhy) {
  OperatorSocket socket(path_);
  refusal_ = "feedback stale";
  const Client client(path_);
  client.say("engage\n");
  poll(socket);
  EXPECT_EQ(client.answer(), "refused: feedback stale\n");
}

TEST_F(OperatorSocketTest, AWordMayComeInPieces) {
  OperatorSocket socket(path_);
  const Client client(path_);
  client.say("sto");
  poll(socket, ms(0));
  EXPECT_TRUE(edges_.empty());
  client.say("p\n");
  poll(socket, ms(500));
  ASSERT_EQ(edges_.size(), 1U);
  EXPECT_EQ(edges_[0], OperatorSocket::Edge::kStop);
}

TEST_F(OperatorSocketTest, OtherWordsAndLongLinesDoNothing) {
  OperatorSocket socket(path_);
  for (const char* words :
       {"ENGAGE\n", "engage \n", "\n", "engage now please\n", "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"}) {
    const Client client(path_);
    client.say(words);
    poll(socket);
    poll(socket);
    EXPECT_EQ(client.answer().rfind("refused: ", 0), 0U) << words;
  }
  EXPECT_TRUE(edges_.empty());
}

TEST_F(OperatorSocketTest, RandomBytesDoNothing) {
  OperatorSocket socket(path_);
  std::mt19937 random(1);
  for (int i = 0; i < 2000; ++i) {
    const Client client(path_);
    std::string bytes(random() % 40, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    client.say(bytes);
    poll(socket, ms(10 * i));
  }
  EXPECT_TRUE(edges_.empty());
}

TEST_F(OperatorSocketTest, WhoIsSlowIsSentAwayAndHoldsUpNobodyElse) {
  OperatorSocket socket(path_);
  const Client slow(path_);
  slow.say("eng");
  const Client quick(path_);
  quick.say("stop\n");
  poll(socket, ms(0));
  EXPECT_EQ(edges_.size(), 1U);
  poll(socket, ms(1001));
  slow.say("age\n");
  poll(socket, ms(1002));
  EXPECT_EQ(edges_.size(), 1U);
}

TEST_F(OperatorSocketTest, AClockThatJumpsBackSendsAwayWhoWaits) {
  OperatorSocket socket(path_);
  const Client client(path_);
  client.say("sto");
  poll(socket, ms(5000));
  poll(socket, ms(4999));
  client.say("p\n");
  poll(socket, ms(5000));
  EXPECT_TRUE(edges_.empty());
}

TEST_F(OperatorSocketTest, OfWhomNobodyKnowsWhoItIsNothingIsTaken) {
  OperatorSocket socket(path_);
  peer_is_unknown = true;
  const Client client(path_);
  client.say("engage\n");
  poll(socket);
  EXPECT_EQ(client.answer(), "refused: it is not known who asks\n");
  EXPECT_TRUE(edges_.empty());
}

TEST_F(OperatorSocketTest, WhoCouldHoldItUpIsSentAwayUnheard) {
  OperatorSocket socket(path_);
  const Client client(path_);
  client.say("engage\n");
  stays_blocking = true;
  poll(socket);
  EXPECT_TRUE(edges_.empty());
  EXPECT_EQ(client.answer(), "");
}

TEST_F(OperatorSocketTest, ACrowdThatSaysNothingIsSentAway) {
  OperatorSocket socket(path_);
  std::vector<std::unique_ptr<Client>> crowd;
  for (int i = 0; i < 20; ++i) crowd.push_back(std::make_unique<Client>(path_));
  poll(socket, ms(0));
  const Client client(path_);
  client.say("stop\n");
  for (int t = 0; t < 5000; t += 100) poll(socket, ms(t));
  EXPECT_EQ(edges_.size(), 1U);
}

TEST_F(OperatorSocketTest, ItsFileIsForOwnerAndGroupAlone) {
  const OperatorSocket socket(path_);
  struct stat status {};
  ASSERT_EQ(stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0660U);
}

TEST_F(OperatorSocketTest, ItsFileGoesWithItAndADeadOneIsReplaced) {
  { const OperatorSocket socket(path_); }
  EXPECT_FALSE(std::filesystem::exists(path_));
  const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path_.c_str(), sizeof(address.sun_path) - 1);
  ASSERT_EQ(bind(dead, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  close(dead);  // its file stays
  OperatorSocket socket(path_);
  EXPECT_TRUE(Client(path_).connected());
}

TEST_F(OperatorSocketTest, AFileInItsPlaceThatIsNoSocketIsLeftAlone) {
  std::ofstream(path_) << "somebody's";
  EXPECT_THROW(OperatorSocket{path_}, std::runtime_error);
  EXPECT_EQ(std::filesystem::file_size(path_), 10u);
}

TEST(OperatorSocketEdge, WhatIsNoEdgeHasNoName) {
  EXPECT_EQ(toString(static_cast<OperatorSocket::Edge>(99)), "unknown edge");
}

TEST_F(OperatorSocketTest, WhereSomebodyListensOrNothingCanBeMadeItIsRefused) {
  const OperatorSocket first(path_);
  EXPECT_THROW(OperatorSocket{path_}, std::runtime_error);
  EXPECT_TRUE(std::filesystem::exists(path_)) << "the first one's file stays";
  EXPECT_THROW(OperatorSocket{folder_ + "/no/such/folder.sock"}, std::runtime_error);
  EXPECT_THROW(OperatorSocket{folder_ + "/" + std::string(200, 'x')}, std::runtime_error);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
