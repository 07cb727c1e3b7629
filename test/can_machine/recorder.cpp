#include "recorder.h"

#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <optional>
#include <stdexcept>

#include "rig.h"
#include "tunnel_pilot/can/linux_frame.h"
#include "tunnel_pilot/can/log_writer.h"

namespace tunnel_pilot::bridge {
namespace {

constexpr const char* kInterface = "can2";
constexpr const char* kPort = "/dev/vport0p1";  // to a file of the machine that emulates this one
constexpr int kReceiveBuffer = 1 << 24;         // [byte]

Stamp wallTime() { return Stamp(std::chrono::system_clock::now().time_since_epoch()); }

int openSocket() {
  const int number = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  const int on = 1;
  const timeval wait{0, 20000};
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(kInterface));
  const bool good =
      address.can_ifindex != 0 && setsockopt(number, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof(on)) == 0 &&
      setsockopt(number, SOL_SOCKET, SO_RCVBUFFORCE, &kReceiveBuffer, sizeof(kReceiveBuffer)) == 0 &&
      setsockopt(number, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof(wait)) == 0 &&
      bind(number, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  if (!good) throw std::runtime_error(std::string("cannot listen to ") + kInterface);
  return number;
}

std::optional<Stamp> stampOf(msghdr& header) {
  for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr; part = CMSG_NXTHDR(&header, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp{};
    std::memcpy(&stamp, CMSG_DATA(part), sizeof(stamp));
    return std::chrono::seconds(stamp.tv_sec) + std::chrono::nanoseconds(stamp.tv_nsec);
  }
  return std::nullopt;
}

}  // namespace

Recorder::Recorder()
    : socket_(openSocket()), offset_(wallTime() - steadyTime()), thread_([this] { run(); }) {}

Recorder::~Recorder() {
  ends_ = true;
  if (thread_.joinable()) thread_.join();
  close(socket_);
}

void Recorder::run() {
  while (!ends_) {
    can_frame in{};
    alignas(cmsghdr) char control[64];
    iovec bytes{&in, sizeof(in)};
    msghdr header{};
    header.msg_iov = &bytes;
    header.msg_iovlen = 1;
    header.msg_control = control;
    header.msg_controllen = sizeof(control);
    if (recvmsg(socket_, &header, 0) != sizeof(in)) continue;
    const auto frame = can::fromLinux(in);
    const auto stamp = stampOf(header);
    if (!frame || !stamp) continue;
    const std::lock_guard<std::mutex> lock(mutex_);
    frames_.emplace_back(*stamp - offset_, *frame);
  }
}

void Recorder::event(const std::string& words, Stamp at) {
  const std::lock_guard<std::mutex> lock(mutex_);
  events_.emplace_back(at, words);
}

std::vector<std::pair<Stamp, can::Frame>> Recorder::since(Stamp begin) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::pair<Stamp, can::Frame>> found;
  std::copy_if(frames_.begin(), frames_.end(), std::back_inserter(found),
               [begin](const auto& one) { return one.first >= begin; });
  return found;
}

void Recorder::handOver(const std::string& name, const std::string& profile) {
  ends_ = true;
  thread_.join();
  const auto earlier = [](const auto& a, const auto& b) { return a.first < b.first; };
  std::stable_sort(events_.begin(), events_.end(), earlier);
  std::stable_sort(frames_.begin(), frames_.end(), earlier);
  std::fstream out(kPort, std::ios::in | std::ios::out);  // which creates no file
  out << "# " << name << " " << profile << "\n";
  can::LogWriter log(out);
  auto event = events_.begin();
  for (const auto& [stamp, frame] : frames_) {
    for (; event != events_.end() && event->first <= stamp; ++event)
      log.event(event->second, event->first);
    log.frame(frame, stamp);
  }
  out << std::flush;
  if (!out) throw std::runtime_error(std::string("cannot write to ") + kPort);
}

}  // namespace tunnel_pilot::bridge
