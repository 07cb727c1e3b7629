#include "tunnel_pilot/ros/step_driver_ros.h"

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {

StepDriverRos::StepDriverRos(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : driver_(drivers::loadStepDriver(Parameters(private_nh).rest())),
      publisher_(nh.advertise<Proposal>("teleoperation/proposal", 1)),
      subscriber_(nh.subscribe("preview_driver/proposal", 1, &StepDriverRos::onProposal, this,
                               ros::TransportHints().tcpNoDelay())) {}

void StepDriverRos::onProposal(const Proposal& message) {
  publisher_.publish(toRos(driver_.propose(toCore(message), nowAfter(message.header.stamp))));
}

}  // namespace tunnel_pilot::shell
