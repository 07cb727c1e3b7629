// can_link_cycle INTERFACE: takes a CAN interface down and up again, which empties all its queues. To be
// installed with cap_net_admin (docs/can.md); so it does nothing else, uses no library but the C
// library's, reads neither files nor environment, and looks hard at its only argument. Exits 0: done; 1:
// refused by the kernel; 2: no such CAN interface, or it was not up; 3: not permitted.
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace {

constexpr int kRefused = 1;
constexpr int kUnknown = 2;
constexpr int kNotPermitted = 3;

struct Message {
  nlmsghdr header;
  ifinfomsg info;
};

bool isName(const char* text) {
  const std::size_t length = strnlen(text, IFNAMSIZ);
  if (length == 0 || length == IFNAMSIZ) return false;
  return std::strspn(text, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-") ==
         length;
}

Message messageFor(int type, int index) {
  static unsigned sequence = 0;
  Message message{};
  message.header.nlmsg_len = sizeof(message);
  message.header.nlmsg_type = static_cast<unsigned short>(type);
  message.header.nlmsg_flags =
      static_cast<unsigned short>(NLM_F_REQUEST | (type == RTM_GETLINK ? 0 : NLM_F_ACK));
  message.header.nlmsg_seq = ++sequence;
  message.info.ifi_family = AF_UNSPEC;
  message.info.ifi_index = index;
  return message;
}

// Sends a question and reads its answer into `buffer`. Returns 0, or errno.
int ask(int socket, const Message& message, void* buffer, std::size_t size) {
  if (send(socket, &message, sizeof(message), 0) < 0) return errno;
  for (;;) {
    const ssize_t count = recv(socket, buffer, size, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    const auto* header = static_cast<const nlmsghdr*>(buffer);
    if (!NLMSG_OK(header, static_cast<unsigned>(count))) return EBADMSG;
    if (header->nlmsg_seq != message.header.nlmsg_seq) continue;
    if (header->nlmsg_type != NLMSG_ERROR) return 0;
    return -static_cast<const nlmsgerr*>(NLMSG_DATA(header))->error;
  }
}

// 0: there is none.
int indexOf(int socket, const char* interface) {
  ifreq request{};
  std::memcpy(request.ifr_name, interface, std::strlen(interface));
  return ioctl(socket, SIOCGIFINDEX, &request) == 0 ? request.ifr_ifindex : 0;
}

bool isCanAndUp(int socket, int index) {
  alignas(nlmsghdr) static char buffer[16384];
  if (ask(socket, messageFor(RTM_GETLINK, index), buffer, sizeof(buffer)) != 0) return false;
  const auto* header = reinterpret_cast<const nlmsghdr*>(buffer);
  if (header->nlmsg_type != RTM_NEWLINK) return false;
  const auto* info = static_cast<const ifinfomsg*>(NLMSG_DATA(header));
  return info->ifi_type == ARPHRD_CAN && (info->ifi_flags & IFF_UP) != 0;
}

int set(int socket, int index, bool up) {
  Message message = messageFor(RTM_NEWLINK, index);
  message.info.ifi_change = IFF_UP;
  message.info.ifi_flags = up ? IFF_UP : 0;
  alignas(nlmsghdr) char buffer[4096];
  return ask(socket, message, buffer, sizeof(buffer));
}

int fail(int status, const char* interface, const char* why) {
  std::fprintf(stderr, "can_link_cycle: %s: %s\n", interface, why);
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 || !isName(argv[1])) {
    return fail(kUnknown, "usage", "can_link_cycle INTERFACE (1 to 15 of [A-Za-z0-9_.-])");
  }
  const char* interface = argv[1];
  const int socket = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
  if (socket < 0) return fail(kRefused, interface, std::strerror(errno));
  const int index = indexOf(socket, interface);
  if (index == 0) return fail(kUnknown, interface, "there is no such interface");
  if (!isCanAndUp(socket, index)) return fail(kUnknown, interface, "not a CAN interface that is up");
  int error = set(socket, index, false);
  if (error == 0) error = set(socket, index, true);
  if (error == EPERM) return fail(kNotPermitted, interface, "cap_net_admin is missing");
  return error == 0 ? 0 : fail(kRefused, interface, std::strerror(error));
}
