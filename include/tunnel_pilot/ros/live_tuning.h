#pragma once

#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/node_handle.h>

#include <functional>
#include <string>
#include <vector>

#include "tunnel_pilot/config/tuning.h"

namespace tunnel_pilot::shell {

/// Serves a stage's config::Tuning by the protocol of dynamic_reconfigure, so that rqt_reconfigure and
/// `dynparam set` change its numbers: service ~set_parameters (dynamic_reconfigure/Reconfigure), latched
/// ~parameter_descriptions (ConfigDescription) and ~parameter_updates (Config). Requests are served in
/// the callback queue of `private_nh`, the stage's own, and so between two of its decisions. One that is
/// refused changes nothing: the answer has the present values, refusal() and the log say why. Values are
/// not written to the parameter server: the stage waits for nobody while it drives, and the next start
/// reads the file again. Nothing throws.
class LiveTuning {
 public:
  using Values = std::vector<double>;

  /// `may_loosen` is asked at each request; `apply` gets all values of each one that was taken.
  LiveTuning(ros::NodeHandle private_nh, config::Tuning tuning, std::function<bool()> may_loosen,
             std::function<void(const Values&)> apply);

  /// Why the last request was refused; empty when it was taken.
  const std::string& refusal() const { return refusal_; }

 private:
  using Reconfigure = dynamic_reconfigure::Reconfigure;

  bool onRequest(Reconfigure::Request& request, Reconfigure::Response& response);

  std::string name_;
  config::Tuning tuning_;
  std::function<bool()> may_loosen_;
  std::function<void(const Values&)> apply_;
  std::string refusal_;
  ros::Publisher descriptions_publisher_, updates_publisher_;
  ros::ServiceServer service_;
};

}  // namespace tunnel_pilot::shell
