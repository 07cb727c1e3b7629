#pragma once

#include <ros/node_handle.h>
#include <tunnel_pilot/Proposal.h>

#include "tunnel_pilot/drivers/step_driver.h"

namespace tunnel_pilot::shell {

/// Shell of drivers::StepDriver. Subscribes `preview_driver/proposal`, publishes each of them with the
/// steps added on `teleoperation/proposal`, the arbiter's source of highest priority. When this node
/// ends, the arbiter goes back to its drivers. Parameters: config/step_driver.yaml. Throws
/// config::ConfigError.
class StepDriverRos {
 public:
  StepDriverRos(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  void onProposal(const Proposal& message);

  drivers::StepDriver driver_;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
};

}  // namespace tunnel_pilot::shell
