#include "tunnel_pilot/ros/lap_monitor.h"

#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kTick = 0.25;  // [s] steady time
constexpr int kTicksPerProgress = 8;
constexpr const char* kStandardOutput = "-";
constexpr double kDegrees = 57.29577951308232;

// Figures are told to a tenth of a millimetre; more digits would be noise.
double rounded(double value) { return std::round(value * 1e4) / 1e4; }

// [s] between two messages' stamps, however far apart: beyond 68 years ros::Time throws.
double between(const SimulatorTruth& earlier, const SimulatorTruth& later) {
  return toSeconds(shell::toCore(later.header.stamp) - shell::toCore(earlier.header.stamp));
}

double since(ros::SteadyTime time) { return (ros::SteadyTime::now() - time).toSec(); }

simulation::TrackSample toSample(const SimulatorTruth& truth) {
  simulation::TrackSample sample;
  sample.time = truth.header.stamp.toSec();
  sample.front = {truth.pose.x, truth.pose.y, truth.pose.theta};
  sample.articulation = truth.articulation;
  sample.speed = truth.speed;
  sample.yaw_rate = truth.yaw_rate;
  sample.station = truth.station;
  sample.lateral_offset = truth.lateral_offset;
  sample.heading_error = truth.heading_error;
  sample.curvature = truth.curvature;
  sample.clearance = truth.clearance;
  return sample;
}

}  // namespace

LapMonitorParameters loadLapMonitor(config::Node node) {
  LapMonitorParameters p{};
  p.lateral_rms_max = node.number("lateral_rms_max", "m", 0.0, 10.0);
  p.lateral_max_max = node.number("lateral_max_max", "m", 0.0, 10.0);
  p.ready_timeout = node.number("ready_timeout", "s", 1.0, 3600.0);
  p.stall_timeout = node.number("stall_timeout", "s", 1.0, 3600.0);
  p.lap_time_max = node.number("lap_time_max", "s", 1.0, 36000.0);
  node.finish();
  return p;
}

LapMonitor::LapMonitor(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  Parameters parameters(private_nh);
  verdict_file_ = parameters.take({"verdict_file"}).text("verdict_file");
  parameters_ = loadLapMonitor(parameters.rest());
  engage_client_ = nh.serviceClient<std_srvs::Trigger>("engage");
  truth_subscriber_ = nh.subscribe("truth", 200, &LapMonitor::onTruth, this);
  status_subscriber_ = nh.subscribe("truck_status", 10, &LapMonitor::onTruckStatus, this);
  arbiter_subscriber_ = nh.subscribe("arbiter_state", 1, &LapMonitor::onArbiterState, this);
  started_ = heard_ = ros::SteadyTime::now();
  timer_ = nh.createWallTimer(ros::WallDuration(kTick), &LapMonitor::onTimer, this);
}

void LapMonitor::onTimer(const ros::WallTimerEvent&) {
  if (passed_) return;
  if (!engaged_ && last_) engage();
  if (++ticks_ % kTicksPerProgress == 0) printProgress();
  if (!engaged_ && since(started_) > parameters_.ready_timeout) finish("not ready: " + refusal_);
  if (engaged_ && since(heard_) > parameters_.stall_timeout) finish("the simulator fell silent");
}

void LapMonitor::engage() {
  std_srvs::Trigger call;
  if (!engage_client_.exists() || !engage_client_.call(call)) return;
  refusal_ = call.response.message;
  engaged_ = call.response.success;
  if (!engaged_) return;
  engaged_at_ = heard_ = ros::SteadyTime::now();
  lap_begin_ = ros::Time::now();
}

void LapMonitor::onTruckStatus(const TruckStatus& message) {
  const bool stopped =
      message.state == TruckStatus::STATE_STOPPING || message.state == TruckStatus::STATE_STOPPED;
  if (engaged_ && !passed_ && stopped) finish("the bridge stopped the truck: " + message.reason_text);
}

void LapMonitor::onTruth(const SimulatorTruth& message) {
  heard_ = ros::SteadyTime::now();
  last_ = message;
  if (engaged_ && !passed_) checkLap(message);
}

// Begins with the first truth of after the engagement: older ones may still have been queued.
void LapMonitor::checkLap(const SimulatorTruth& message) {
  if (!first_ && message.header.stamp < lap_begin_) return;
  if (!first_) first_ = message;
  track_.push_back(toSample(message));
  const double time = between(*first_, message);
  if (!message.on_design_line || message.lap_length <= 0.0) {
    return finish("the world has no design line to drive a lap of");
  }
  if (message.contacts > first_->contacts) return finish("a body touched a wall or an obstacle");
  if (message.station - first_->station >= message.lap_length) return finish("");
  if (time > parameters_.lap_time_max) finish("no lap within the time allowed; " + reason_);
}

void LapMonitor::printProgress() const {
  if (!first_) {
    std::printf("waiting to be engaged: %s\n", refusal_.c_str());
  } else {
    std::printf("lap %3.0f %%  %5.1f s  %4.2f m/s  offset %+5.2f m  clearance %4.2f m  %s\n",
                100.0 * (last_->station - first_->station) / last_->lap_length, between(*first_, *last_),
                last_->speed, last_->lateral_offset, last_->clearance, reason_.c_str());
  }
  std::fflush(stdout);
}

simulation::Metrics LapMonitor::metrics() const {
  auto metrics = simulation::driveMetrics(track_, geometry::Path());
  if (first_ && last_) metrics["lap_time"] = between(*first_, *last_);
  return metrics;
}

void LapMonitor::finish(const std::string& failure) {
  std::string reason = failure;
  nlohmann::json figures = nlohmann::json::object();
  if (!track_.empty()) {
    const auto m = metrics();
    if (reason.empty() && m.at("lateral_rms") > parameters_.lateral_rms_max) reason = "lateral RMS";
    if (reason.empty() && m.at("lateral_max") > parameters_.lateral_max_max) reason = "lateral max";
    figures = {{"lap_time_s", rounded(m.at("lap_time"))},
               {"lateral_mean_m", rounded(m.at("lateral_mean"))},
               {"lateral_rms_m", rounded(m.at("lateral_rms"))},
               {"lateral_max_m", rounded(m.at("lateral_max"))},
               {"heading_mean_deg", rounded(m.at("heading_mean") * kDegrees)},
               {"clearance_min_m", rounded(m.at("clearance_min"))},
               {"contacts", last_->contacts - first_->contacts},
               {"real_time_factor", rounded(m.at("lap_time") / since(engaged_at_))}};
  }
  passed_ = reason.empty();
  if (!*passed_) figures["reason"] = reason;
  verdict_ = (*passed_ ? "PASS " : "FAIL ") + figures.dump();
  std::ofstream file;
  if (verdict_file_ != kStandardOutput) file.open(verdict_file_);
  if (!file.is_open() || !(file << verdict_ << "\n").flush()) {
    std::printf("%s\n", verdict_.c_str());
    std::fflush(stdout);
  }
  ros::requestShutdown();
}

}  // namespace tunnel_pilot::shell
