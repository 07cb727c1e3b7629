#include "tunnel_pilot/can/can_socket.h"

#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/rtnetlink.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "tunnel_pilot/can/linux_frame.h"

namespace tunnel_pilot::can {
namespace {

constexpr int kNetlinkReceiveBuffer = 1 << 20;  // [byte] some thousand changes
constexpr can_err_mask_t kErrorClasses =
    CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;

void checkInterface(const std::string& name) {
  const char* allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-";
  if (name.empty() || name.size() >= IFNAMSIZ || name.find_first_not_of(allowed) != std::string::npos ||
      name == "." || name == "..") {
    throw std::invalid_argument("SocketCAN: the interface '" + name +
                                "' must be 1 to 15 of [A-Za-z0-9_.-]");
  }
}

/// A file descriptor that is closed with its owner.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor() { reset(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  void reset(int number = -1) {
    if (number_ >= 0) ::close(number_);
    number_ = number;
  }
  int get() const { return number_; }

 private:
  int number_;
};

// -------- rtnetlink

template <class Visit>
void forEachAttribute(const rtattr* first, int length, const Visit& visit) {
  for (const rtattr* a = first; RTA_OK(a, length); a = RTA_NEXT(a, length)) {
    visit(a->rta_type & NLA_TYPE_MASK, RTA_DATA(a), static_cast<int>(RTA_PAYLOAD(a)));
  }
}

template <class Value>
Value valueOf(const void* data, int length) {
  Value value{};
  std::memcpy(&value, data, std::min(sizeof(value), static_cast<std::size_t>(length)));
  return value;
}

BusState stateOf(std::uint32_t kernel_state) {
  switch (kernel_state) {
    case CAN_STATE_ERROR_ACTIVE:
      return BusState::kActive;
    case CAN_STATE_ERROR_WARNING:
      return BusState::kWarning;
    case CAN_STATE_ERROR_PASSIVE:
      return BusState::kPassive;
    case CAN_STATE_BUS_OFF:
      return BusState::kBusOff;
    default:
      return BusState::kDown;  // stopped or asleep
  }
}

void readController(const void* data, int length, CanLink& link) {
  forEachAttribute(static_cast<const rtattr*>(data), length, [&](int type, const void* value, int size) {
    if (type == IFLA_CAN_STATE) link.state = stateOf(valueOf<std::uint32_t>(value, size));
    if (type == IFLA_CAN_RESTART_MS) link.restart_ms = valueOf<std::uint32_t>(value, size);
    if (type == IFLA_CAN_BITTIMING) link.configured = valueOf<can_bittiming>(value, size).bitrate != 0;
  });
}

void readLinkInfo(const void* data, int length, CanLink& link) {
  const auto* first = static_cast<const rtattr*>(data);
  forEachAttribute(first, length, [&](int type, const void* value, int size) {
    if (type == IFLA_INFO_KIND) {
      const std::string_view kind(static_cast<const char*>(value), static_cast<std::size_t>(size));
      link.controller = kind.substr(0, kind.find('\0')) == "can";
    }
  });
  if (!link.controller) return;
  forEachAttribute(first, length, [&](int type, const void* value, int size) {
    if (type == IFLA_INFO_DATA) readController(value, size, link);
  });
}

struct LinkMessage {
  int index = 0;
  std::string name;
  CanLink link;
};

LinkMessage readLink(const nlmsghdr* header) {
  const auto* info = static_cast<const ifinfomsg*>(NLMSG_DATA(header));
  LinkMessage message;
  message.index = info->ifi_index;
  message.link.present = header->nlmsg_type == RTM_NEWLINK && info->ifi_type == ARPHRD_CAN;
  message.link.up = (info->ifi_flags & IFF_UP) != 0;
  message.link.carrier = (info->ifi_flags & IFF_LOWER_UP) != 0;
  message.link.echoes = (info->ifi_flags & IFF_ECHO) != 0;
  forEachAttribute(IFLA_RTA(info), static_cast<int>(IFLA_PAYLOAD(header)),
                   [&](int type, const void* value, int size) {
                     if (type == IFLA_IFNAME) {
                       const auto* name = static_cast<const char*>(value);
                       message.name.assign(name, strnlen(name, static_cast<std::size_t>(size)));
                     }
                     if (type == IFLA_LINKINFO) readLinkInfo(value, size, message.link);
                   });
  if (!message.link.present) message.link = CanLink();
  return message;
}

struct LinkRequest {
  nlmsghdr header{};
  ifinfomsg info{};
  rtattr attribute{};
  std::array<char, IFNAMSIZ> name{};
};

LinkRequest requestOf(const std::string& name, std::uint32_t sequence) {
  LinkRequest request;
  request.header.nlmsg_len = sizeof(request);
  request.header.nlmsg_type = RTM_GETLINK;
  request.header.nlmsg_flags = NLM_F_REQUEST;
  request.header.nlmsg_seq = sequence;
  request.info.ifi_family = AF_UNSPEC;
  request.attribute.rta_type = IFLA_IFNAME;
  request.attribute.rta_len = sizeof(request.attribute) + sizeof(request.name);
  std::memcpy(request.name.data(), name.c_str(), name.size());
  return request;
}

int openNetlink(unsigned groups) {
  const int number = socket(AF_NETLINK, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, NETLINK_ROUTE);
  if (number < 0) throw std::runtime_error(std::string("SocketCAN: rtnetlink: ") + std::strerror(errno));
  sockaddr_nl address{};
  address.nl_family = AF_NETLINK;
  address.nl_groups = groups;
  setsockopt(number, SOL_SOCKET, SO_RCVBUF, &kNetlinkReceiveBuffer, sizeof(kNetlinkReceiveBuffer));
  if (bind(number, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    const std::string why = std::strerror(errno);
    ::close(number);
    throw std::runtime_error("SocketCAN: rtnetlink: " + why);
  }
  return number;
}

// -------- the raw socket

can_filter filterOf(const Identifier& identifier) {
  const canid_t flags = CAN_EFF_FLAG | CAN_RTR_FLAG;
  if (identifier.extended)
    return {identifier.id | CAN_EFF_FLAG, (identifier.mask & CAN_EFF_MASK) | flags};
  return {identifier.id, CAN_SFF_MASK | flags};
}

/// 0 or errno. Everything is set before the socket is bound: it never hears what it shall not.
int setUp(int number, const std::vector<Identifier>& listen, int index) {
  std::vector<can_filter> filters;
  filters.reserve(listen.size());
  for (const Identifier& identifier : listen) filters.push_back(filterOf(identifier));
  const int on = 1;
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  const auto size = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  const bool good =
      setsockopt(number, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), size) == 0 &&
      setsockopt(number, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &kErrorClasses, sizeof(kErrorClasses)) == 0 &&
      setsockopt(number, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof(on)) == 0 &&
      bind(number, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  return good ? 0 : errno;
}

Received received(const can_frame& in, int flags) {
  Received out;
  if ((in.can_id & CAN_ERR_FLAG) != 0) {
    out.kind = Received::Kind::kErrorFrame;
    out.frame.id = in.can_id & CAN_ERR_MASK;
    out.frame.length = CAN_ERR_DLC;
    std::memcpy(out.frame.data.data(), in.data, out.frame.data.size());
    return out;
  }
  const std::optional<Frame> frame = fromLinux(in);
  out.kind = Received::Kind::kOther;
  if (!frame) return out;
  out.frame = *frame;
  out.kind = (flags & MSG_CONFIRM) != 0 ? Received::Kind::kEcho : Received::Kind::kFrame;
  return out;
}

// -------- the helper's answers

std::string helperError(int status) {
  if (!WIFEXITED(status)) return "it was killed";
  switch (WEXITSTATUS(status)) {
    case 2:
      return "it does not know this interface";
    case 3:
      return "it may not: setcap cap_net_admin+ep is missing";
    case 127:
      return "it is not installed";
    default:
      return "exit status " + std::to_string(WEXITSTATUS(status));
  }
}

class LinuxCanSocket : public CanSocket {
 public:
  LinuxCanSocket(std::string interface, std::string helper)
      : interface_(std::move(interface)),
        helper_(std::move(helper)),
        changes_(openNetlink(RTMGRP_LINK)),
        questions_(openNetlink(0)) {}
  ~LinuxCanSocket() override {
    if (helper_id_ > 0) waitpid(helper_id_, nullptr, 0);
  }

  int open(const std::vector<Identifier>& listen) override {
    close();
    const int index = ask().index;
    if (index == 0) return ENODEV;
    socket_.reset(socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
    if (socket_.get() < 0) return errno;
    const int error = setUp(socket_.get(), listen, index);
    if (error != 0) close();
    if (error == 0) index_ = index;
    return error;
  }

  void close() override {
    socket_.reset();
    index_ = 0;
  }

  int send(const Frame& frame) override {
    const can_frame out = toLinux(frame);
    return write(socket_.get(), &out, sizeof(out)) == sizeof(out) ? 0 : errno;
  }

  Received receive() override {
    can_frame in{};
    iovec bytes{&in, sizeof(in)};
    msghdr header{};
    header.msg_iov = &bytes;
    header.msg_iovlen = 1;
    const ssize_t count = recvmsg(socket_.get(), &header, MSG_DONTWAIT);
    if (count == sizeof(in)) return received(in, header.msg_flags);
    Received nothing;
    if (count >= 0) {
      nothing.kind = Received::Kind::kOther;
    } else if (errno != EAGAIN && errno != EINTR) {
      nothing.kind = Received::Kind::kError;
      nothing.error = errno;
    }
    return nothing;
  }

  CanLink link() override { return ask().link; }

  std::optional<CanLink> nextChange() override {
    alignas(nlmsghdr) std::array<char, 16384> buffer;
    for (;;) {
      const ssize_t count = recv(changes_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (count < 0 && errno == ENOBUFS) return link();  // some were lost
      if (count < static_cast<ssize_t>(sizeof(nlmsghdr))) return std::nullopt;
      const auto* header = reinterpret_cast<const nlmsghdr*>(buffer.data());
      if (!NLMSG_OK(header, static_cast<unsigned>(count))) continue;
      if (header->nlmsg_type != RTM_NEWLINK && header->nlmsg_type != RTM_DELLINK) continue;
      const LinkMessage message = readLink(header);
      const bool named = message.name == interface_;
      const bool renamed = !named && index_ != 0 && message.index == index_;
      if (named) return message.link;
      if (renamed) return CanLink();
    }
  }

  bool startCycle() override {
    std::array<char*, 3> arguments{helper_.data(), interface_.data(), nullptr};
    const int error =
        posix_spawn(&helper_id_, helper_.c_str(), nullptr, nullptr, arguments.data(), environ);
    if (error == 0) return true;
    helper_id_ = 0;
    start_error_ = error == ENOENT ? "it is not installed" : std::strerror(error);
    return false;
  }

  LinkCycle cycle() override {
    if (!start_error_.empty()) {
      LinkCycle failed{LinkCycle::Stage::kFailed, start_error_};
      start_error_.clear();
      return failed;
    }
    if (helper_id_ == 0) return {};
    int status = 0;
    const pid_t done = waitpid(helper_id_, &status, WNOHANG);
    if (done == 0) return {LinkCycle::Stage::kRunning, ""};
    helper_id_ = 0;
    if (done > 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0) return {LinkCycle::Stage::kDone, ""};
    return {LinkCycle::Stage::kFailed, done < 0 ? "its end was missed" : helperError(status)};
  }

  int descriptor() const override { return socket_.get(); }

 private:
  LinkMessage ask() {
    const LinkRequest request = requestOf(interface_, ++sequence_);
    if (::send(questions_.get(), &request, sizeof(request), 0) < 0) return {};
    alignas(nlmsghdr) std::array<char, 16384> buffer;
    for (;;) {  // the kernel has answered before send() returned
      const ssize_t count = recv(questions_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (count < static_cast<ssize_t>(sizeof(nlmsghdr))) return {};
      const auto* header = reinterpret_cast<const nlmsghdr*>(buffer.data());
      if (!NLMSG_OK(header, static_cast<unsigned>(count)) || header->nlmsg_seq != sequence_) continue;
      return header->nlmsg_type == RTM_NEWLINK ? readLink(header) : LinkMessage();
    }
  }

  std::string interface_;
  std::string helper_;
  Descriptor changes_;
  Descriptor questions_;
  Descriptor socket_;
  int index_ = 0;  ///< of the interface that is open
  std::uint32_t sequence_ = 0;
  pid_t helper_id_ = 0;
  std::string start_error_;
};

}  // namespace

bool matches(const Identifier& identifier, const Frame& frame) {
  const std::uint32_t mask = identifier.extended ? identifier.mask : CAN_SFF_MASK;
  return frame.extended == identifier.extended && ((frame.id ^ identifier.id) & mask) == 0;
}

std::unique_ptr<CanSocket> openCanSocket(const std::string& interface, const std::string& helper) {
  checkInterface(interface);
  const Descriptor probe(socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  if (probe.get() < 0) {
    throw std::runtime_error(std::string("SocketCAN: this kernel has no CAN: ") + std::strerror(errno));
  }
  return std::make_unique<LinuxCanSocket>(interface, helper);
}

}  // namespace tunnel_pilot::can
