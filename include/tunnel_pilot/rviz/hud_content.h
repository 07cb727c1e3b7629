#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <sensor_msgs/JointState.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <tunnel_pilot/TunnelState.h>

#include <optional>
#include <string>
#include <vector>

namespace tunnel_pilot::hud {

/// Now, by both clocks: ROS time may stand still, go slowly or jump, steady time does not.
struct Moment {
  ros::Time time;
  ros::SteadyTime steady;
};

/// How far a message may be believed: kAged is shown in grey, kLost not at all.
enum class Freshness { kFresh, kAged, kLost };

/// Freshness of something of this age and this silent for so long. [s], [s] ROS and steady time
Freshness freshness(double age, double silence, double steady_silence);

/// The last message of a topic and when it came.
template <class Message>
class Heard {
 public:
  void set(const Message& message, const Moment& moment) {
    message_ = message;
    received_ = moment;
  }
  bool any() const { return message_.has_value(); }
  const Message& message() const { return *message_; }

  double age(const Moment& now) const { return (now.time - message_->header.stamp).toSec(); }  // [s]
  double steadySilence(const Moment& now) const {
    return (now.steady - received_.steady).toSec();
  }  // [s]

  /// Of a message whose stamp says when it was measured.
  Freshness measured(const Moment& now) const {
    return any() ? freshness(age(now), silence(now), steadySilence(now)) : Freshness::kLost;
  }
  /// Of a message that tells a decision, whose stamp may rightly be old.
  Freshness spoken(const Moment& now) const {
    return any() ? freshness(0.0, silence(now), steadySilence(now)) : Freshness::kLost;
  }

 private:
  double silence(const Moment& now) const { return (now.time - received_.time).toSec(); }

  std::optional<Message> message_;
  Moment received_;
};

/// All that was heard.
struct HudInput {
  Heard<TunnelState> tunnel;
  Heard<ArbiterState> arbiter;
  Heard<TruckStatus> truck;
  Heard<sensor_msgs::JointState> joints;
  Heard<TruckCommand> command;
  Heard<Proposal> network;  ///< lidar_driver's
  Heard<Proposal> preview;  ///< preview_driver's
  Heard<nav_msgs::Odometry> odometry;
};

enum class Tone { kNormal, kGood, kStandby, kCaution, kAlarm, kStale };

struct Text {
  std::string text;
  Tone tone = Tone::kStale;
};

/// A bar with a mark across it, as shares of the full scale: 0 to 1, or -1 to 1 where a value has a sign
/// (positive to the left). Empty: not known.
struct Gauge {
  std::optional<double> value, mark;
  Tone tone = Tone::kStale;
};

/// What stands on the HUD.
struct HudContent {
  Text state, mode, reason, source;
  Text speed, asked_speed, limited_by, speed_limit;
  Gauge speed_gauge;  ///< mark: the speed asked for
  Text articulation, commanded;
  Gauge articulation_gauge;          ///< mark: the command
  Text lateral, heading, no_tunnel;  ///< no_tunnel: why there are no numbers, else empty
  Gauge lateral_gauge, heading_gauge;
  Text network_angle, confidence, model, hash;
  std::vector<double> outputs;  ///< 0 to 1, the first one's articulation rightmost
  Gauge network_gauge;          ///< decoded, over the outputs' range; mark: preview_driver's
  Text scan_age, feedback_age;
};
bool operator==(const Text& a, const Text& b);
bool operator==(const Gauge& a, const Gauge& b);
bool operator==(const HudContent& a, const HudContent& b);

/// What the HUD shows of all that was heard. Nothing that is old looks as if it were fresh: it turns
/// grey, then becomes "no data". Numbers are rounded to what can be seen, so that equal contents look
/// alike.
HudContent describeHud(const HudInput& input, const Moment& now);

}  // namespace tunnel_pilot::hud
