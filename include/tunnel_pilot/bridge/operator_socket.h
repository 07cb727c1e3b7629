#pragma once

#include <functional>
#include <memory>
#include <string>

#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::bridge {

/// The operator's edges by a path that no network reaches: a local stream socket, to which who may write
/// to its file connects, says one line ("engage", "release", "stop" or "reset") and gets one back ("ok",
/// or "refused: " and why). Other words, long lines and whoever takes more than a second to say one are
/// refused. Never blocks.
class OperatorSocket {
 public:
  enum class Edge { kEngage, kRelease, kStop, kReset };

  /// Answers an edge: empty when it is accepted, else why not. `user` is the number of the one who asks,
  /// as the kernel knows it.
  using Handler = std::function<std::string(Edge edge, unsigned user)>;

  /// Makes the socket's file, for its owner and group alone. One that nobody listens on any more is
  /// replaced. Throws std::runtime_error when it cannot be made, or somebody listens there.
  explicit OperatorSocket(const std::string& path);
  ~OperatorSocket();

  /// Hears whoever has spoken. Call it often; `now` is of a steady clock.
  void poll(Stamp now, const Handler& handler);

 private:
  class Listener;
  std::unique_ptr<Listener> listener_;
};

std::string toString(OperatorSocket::Edge edge);

}  // namespace tunnel_pilot::bridge
