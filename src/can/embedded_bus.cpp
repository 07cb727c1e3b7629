#include "tunnel_pilot/can/embedded_bus.h"

#include <dirent.h>
#include <linux/can.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "tunnel_pilot/can/linux_frame.h"

namespace tunnel_pilot::can {
namespace {

constexpr int kBindTries = 10;

static_assert(sizeof(can_frame) == 16, "the datagrams' layout is part of the interface");

void checkName(const std::string& name) {
  const char* allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
  if (name.empty() || name.size() > 32 || name.find_first_not_of(allowed) != std::string::npos) {
    throw std::invalid_argument("embedded CAN bus: the name '" + name +
                                "' must be 1 to 32 of [A-Za-z0-9_-]");
  }
}

/// Makes a folder that is ours alone; someone else's (a trap laid in /tmp) is refused.
void makePrivateFolder(const std::string& folder) {
  if (mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    throw std::runtime_error("embedded CAN bus: cannot make " + folder + ": " + std::strerror(errno));
  }
  struct stat info {};
  if (lstat(folder.c_str(), &info) != 0 || !S_ISDIR(info.st_mode) || info.st_uid != geteuid()) {
    throw std::runtime_error("embedded CAN bus: " + folder + " is not a folder of this user");
  }
}

std::string busFolder(const std::string& name) {
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  const bool has_runtime = runtime != nullptr && runtime[0] == '/' && access(runtime, W_OK) == 0;
  std::string base = "/tmp/tunnel_pilot_can." + std::to_string(geteuid());
  if (has_runtime) base = std::string(runtime) + "/tunnel_pilot_can";
  makePrivateFolder(base);
  return base + "/" + name;
}

sockaddr_un addressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    throw std::runtime_error("embedded CAN bus: the path " + path + " is too long for a socket");
  }
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  return address;
}

/// Calls `visit(path)` for every socket file of the folder. False when the folder cannot be read.
template <class Visit>
bool forEachSocket(const std::string& folder, const Visit& visit) {
  DIR* directory = opendir(folder.c_str());
  if (directory == nullptr) return false;
  while (const dirent* entry = readdir(directory)) {
    std::string path = folder;
    path.append("/").append(entry->d_name);
    if (path.compare(path.size() - 5, 5, ".sock") == 0) visit(path);
  }
  closedir(directory);
  return true;
}

}  // namespace

EmbeddedBus::EmbeddedBus(const std::string& name) {
  checkName(name);
  folder_ = busFolder(name);
  static std::atomic<unsigned> count{0};
  path_ = folder_ + "/" + std::to_string(getpid()) + "-" + std::to_string(count++) + ".sock";
  const sockaddr_un address = addressOf(path_);
  makePrivateFolder(folder_);
  removeStaleSockets();
  socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_ < 0)
    throw std::runtime_error(std::string("embedded CAN bus: socket: ") + std::strerror(errno));
  unlink(path_.c_str());  // left by a dead process that had our number
  int bound = -1;
  for (int i = 0; i < kBindTries; ++i) {
    bound = bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
    if (bound == 0 || errno != ENOENT) break;
    makePrivateFolder(folder_);  // the last one before us left meanwhile, and took it along
  }
  if (bound != 0) {
    const std::string why = std::strerror(errno);
    close(socket_);
    throw std::runtime_error("embedded CAN bus: cannot bind " + path_ + ": " + why);
  }
}

EmbeddedBus::~EmbeddedBus() {
  unlink(path_.c_str());
  close(socket_);
  rmdir(folder_.c_str());  // refused as long as anybody else is on the bus
}

void EmbeddedBus::removeStaleSockets() {
  const int probe = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (probe < 0) return;
  forEachSocket(folder_, [&](const std::string& path) {
    if (path.size() >= sizeof(sockaddr_un::sun_path)) return;
    const sockaddr_un address = addressOf(path);
    const auto* target = reinterpret_cast<const sockaddr*>(&address);
    if (connect(probe, target, sizeof(address)) != 0 && errno == ECONNREFUSED) unlink(path.c_str());
  });
  close(probe);
}

bool EmbeddedBus::send(const Frame& frame) {
  const can_frame out = toLinux(frame);
  const bool listed = forEachSocket(folder_, [&](const std::string& path) {
    if (path != path_) sendTo(path, &out, sizeof(out));
  });
  if (listed) ++confirmed_;
  return listed;
}

void EmbeddedBus::sendTo(const std::string& path, const void* bytes, std::size_t count) {
  if (path.size() >= sizeof(sockaddr_un::sun_path)) return;
  const sockaddr_un address = addressOf(path);
  const auto* target = reinterpret_cast<const sockaddr*>(&address);
  if (sendto(socket_, bytes, count, MSG_DONTWAIT | MSG_NOSIGNAL, target, sizeof(address)) >= 0) return;
  if (errno == ECONNREFUSED) {
    unlink(path.c_str());  // its owner is dead
  } else if (errno != ENOENT) {
    ++dropped_;
  }
}

std::optional<Frame> EmbeddedBus::receive() {
  for (;;) {
    can_frame in{};
    const ssize_t count = recv(socket_, &in, sizeof(in), MSG_DONTWAIT | MSG_TRUNC);
    if (count < 0) return std::nullopt;
    const std::optional<Frame> frame =
        count == static_cast<ssize_t>(sizeof(in)) ? fromLinux(in) : std::nullopt;
    if (frame) return frame;
    ++malformed_;
  }
}

BusState EmbeddedBus::state() const {
  return access(path_.c_str(), F_OK) == 0 ? BusState::kActive : BusState::kDown;
}

}  // namespace tunnel_pilot::can
