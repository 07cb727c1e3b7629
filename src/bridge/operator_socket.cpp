#include "tunnel_pilot/bridge/operator_socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/write.hpp>
#include <list>
#include <optional>
#include <stdexcept>
#include <utility>

namespace tunnel_pilot::bridge {
namespace {

using Local = boost::asio::local::stream_protocol;
using Error = boost::system::error_code;
using Edge = OperatorSocket::Edge;

constexpr std::size_t kLongestLine = 16;  // [bytes]
constexpr std::size_t kMostAtOnce = 8;    // who speaks at the same time
constexpr Stamp kPatience = std::chrono::seconds(1);
constexpr std::array<Edge, 4> kEdges = {Edge::kEngage, Edge::kRelease, Edge::kStop, Edge::kReset};

std::optional<Edge> edgeOf(const std::string& word) {
  for (const Edge edge : kEdges) {
    if (word == toString(edge)) return edge;
  }
  return std::nullopt;
}

// The kernel's word for who is at the other end.
std::optional<unsigned> userOf(Local::socket& peer) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (getsockopt(peer.native_handle(), SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) {
    return std::nullopt;
  }
  return credentials.uid;
}

void removeIfDead(boost::asio::io_context& context, const std::string& path) {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0 || !S_ISSOCK(status.st_mode)) return;
  Local::socket probe(context);
  Error error;
  probe.connect(Local::endpoint(path), error);
  if (!error) throw std::runtime_error("operator socket " + path + ": somebody listens there");
  unlink(path.c_str());
}

}  // namespace

class OperatorSocket::Listener {
 public:
  explicit Listener(const std::string& path) : path_(path), acceptor_(context_) {
    try {
      removeIfDead(context_, path);
      acceptor_.open(Local());
      const mode_t before = umask(0117);  // the file is never there for others, not even at first
      Error error;
      acceptor_.bind(Local::endpoint(path), error);
      umask(before);
      if (error) throw boost::system::system_error(error);
      acceptor_.listen();
      acceptor_.non_blocking(true);
    } catch (const boost::system::system_error& error) {
      throw std::runtime_error("operator socket " + path + ": " + error.code().message());
    }
  }
  ~Listener() { unlink(path_.c_str()); }

  void poll(Stamp now, const Handler& handler) {
    accept(now);
    for (auto guest = guests_.begin(); guest != guests_.end();) {
      guest = serve(*guest, now, handler) ? guests_.erase(guest) : std::next(guest);
    }
  }

 private:
  struct Guest {
    Local::socket peer;
    Stamp since;
    std::string line;
  };

  void accept(Stamp now) {
    while (guests_.size() < kMostAtOnce) {
      Error error;
      Local::socket peer(context_);
      acceptor_.accept(peer, error);
      if (error) return;
      peer.non_blocking(true, error);
      if (!error) guests_.push_back({std::move(peer), now, ""});
    }
  }

  // True when there is nothing more to say to this one.
  static bool serve(Guest& guest, Stamp now, const Handler& handler) {
    std::array<char, kLongestLine> bytes{};
    Error error;
    const std::size_t count = guest.peer.read_some(boost::asio::buffer(bytes), error);
    guest.line.append(bytes.data(), count);
    const std::size_t end = guest.line.find('\n');
    if (end != std::string::npos) {
      answer(guest, answerTo(guest, guest.line.substr(0, end), handler));
      return true;
    }
    if (guest.line.size() >= kLongestLine) {
      answer(guest, "refused: the line is too long");
      return true;
    }
    const bool waits = error == boost::asio::error::would_block || !error;
    return !waits || now - guest.since > kPatience || now < guest.since;
  }

  static std::string answerTo(Guest& guest, const std::string& word, const Handler& handler) {
    const std::optional<Edge> edge = edgeOf(word);
    if (!edge) return "refused: say engage, release, stop or reset";
    const std::optional<unsigned> user = userOf(guest.peer);
    if (!user) return "refused: it is not known who asks";
    const std::string why = handler(*edge, *user);
    if (why.empty()) return "ok";
    return "refused: " + why;
  }

  // What does not fit into the socket's buffer is lost: nobody is waited for.
  static void answer(Guest& guest, const std::string& text) {
    Error lost;
    boost::asio::write(guest.peer, boost::asio::buffer(text + "\n"), lost);
  }

  std::string path_;
  boost::asio::io_context context_;
  Local::acceptor acceptor_;
  std::list<Guest> guests_;
};

OperatorSocket::OperatorSocket(const std::string& path) : listener_(std::make_unique<Listener>(path)) {}
OperatorSocket::~OperatorSocket() = default;

void OperatorSocket::poll(Stamp now, const Handler& handler) { listener_->poll(now, handler); }

std::string toString(OperatorSocket::Edge edge) {
  switch (edge) {
    case Edge::kEngage:
      return "engage";
    case Edge::kRelease:
      return "release";
    case Edge::kStop:
      return "stop";
    case Edge::kReset:
      return "reset";
  }
  return "unknown edge";
}

}  // namespace tunnel_pilot::bridge
