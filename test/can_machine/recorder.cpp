#include "recorder.h"

#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <fstream>
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

long counter(const std::string& interface, const std::string& name) {
  long count = 0;
  std::ifstream file("/sys/class/net/" + interface + "/statistics/" + name);
  if (!(file >> count)) throw std::runtime_error("cannot read " + name + " of " + interface);
  return count;
}

long heard() { return counter(kInterface, "rx_packets"); }
long sent() { return counter("can0", "tx_packets") + counter("can1", "tx_packets"); }

/// Frames that the controller had no room for (each stands for some), or the kernel.
long lost() {
  return counter(kInterface, "rx_over_errors") + counter(kInterface, "rx_errors") +
         counter(kInterface, "rx_dropped") + counter(kInterface, "rx_missed_errors");
}

int openSocket() {
  const int number = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  const int on = 1;
  const timeval wait{0, 20000};
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(kInterface));
  const bool good =
      address.can_ifindex != 0 && setsockopt(number, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof(on)) == 0 &&
      setsockopt(number, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof(on)) == 0 &&
      setsockopt(number, SOL_SOCKET, SO_RCVBUFFORCE, &kReceiveBuffer, sizeof(kReceiveBuffer)) == 0 &&
      setsockopt(number, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof(wait)) == 0 &&
      bind(number, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  if (!good) throw std::runtime_error(std::string("cannot listen to ") + kInterface);
  return number;
}

/// What the kernel tells beside a frame; false when it does not.
template <class Value>
bool take(msghdr& header, int type, Value& value) {
  for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr; part = CMSG_NXTHDR(&header, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != type) continue;
    std::memcpy(&value, CMSG_DATA(part), sizeof(value));
    return true;
  }
  return false;
}

}  // namespace

Recorder::Recorder()
    : socket_(openSocket()),
      heard_before_(heard()),
      lost_before_(lost()),
      sent_before_(sent()),
      offset_(wallTime() - steadyTime()),
      thread_([this] { run(); }) {}

Recorder::~Recorder() {
  ends_ = true;
  if (thread_.joinable()) thread_.join();
  close(socket_);
}

void Recorder::run() {
  for (;;) {
    const bool last = ends_;  // then what waits is read, and no more
    can_frame in{};
    alignas(cmsghdr) char control[128];
    iovec bytes{&in, sizeof(in)};
    msghdr header{};
    header.msg_iov = &bytes;
    header.msg_iovlen = 1;
    header.msg_control = control;
    header.msg_controllen = sizeof(control);
    if (recvmsg(socket_, &header, last ? MSG_DONTWAIT : 0) != sizeof(in)) {
      if (last) return;
      continue;
    }
    ++heard_;
    take(header, SO_RXQ_OVFL, unread_);
    timespec at{};
    const auto frame = can::fromLinux(in);
    if (!frame || !take(header, SCM_TIMESTAMPNS, at)) continue;
    const Stamp stamp = std::chrono::seconds(at.tv_sec) + std::chrono::nanoseconds(at.tv_nsec);
    const std::lock_guard<std::mutex> lock(mutex_);
    frames_.emplace_back(stamp - offset_, *frame);
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

// A controller that hangs does not count what it sent, hence no equality.
std::string Recorder::end() {
  ends_ = true;
  thread_.join();
  if (lost() != lost_before_) return "overrun";
  if (unread_ != 0) return "unread";
  if (heard() - heard_before_ != heard_) return "uncounted";
  if (heard() - heard_before_ < sent() - sent_before_) return "unheard";
  return "nothing";
}

void Recorder::handOver(const std::string& name, const std::string& profile) {
  const std::string missing = end();
  const auto earlier = [](const auto& a, const auto& b) { return a.first < b.first; };
  std::stable_sort(events_.begin(), events_.end(), earlier);
  std::stable_sort(frames_.begin(), frames_.end(), earlier);
  std::fstream out(kPort, std::ios::in | std::ios::out);  // which creates no file
  out << "# " << name << " " << profile << " " << missing << "\n";
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
