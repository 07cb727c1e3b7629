#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>

#include <functional>
#include <string>

namespace tunnel_pilot::shell {

/// Tells a stage's condition on /diagnostics four times a second of steady time: who has only begun to
/// listen knows it within a second even if connecting takes a while, and when simulated time stands still
/// as well. The callback runs in the stage's own callback queue.
class Diagnostics {
 public:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;

  /// `stage` is the noun of the stage; `fill` writes level, message and values.
  Diagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const std::string& stage,
              std::function<void(Status&)> fill);

  /// Tells it now as well: after a transition.
  void tell() { updater_.force_update(); }

 private:
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace tunnel_pilot::shell
