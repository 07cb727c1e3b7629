#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <fcntl.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <sys/wait.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/TruckStatus.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tunnel_pilot/supervision/command.h"
#ifdef TUNNEL_PILOT_HUD
#include "tunnel_pilot/rviz/hud_content.h"
#endif

namespace tunnel_pilot::shell {

inline bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// The program `status`; its lines come out of a pipe.
class StatusProgram {
 public:
  StatusProgram() {
    int ends[2] = {-1, -1};
    if (pipe(ends) != 0) return;
    output_ = ends[0];
    fcntl(output_, F_SETFL, O_NONBLOCK);
    fcntl(output_, F_SETFD, FD_CLOEXEC);
    process_ = fork();
    if (process_ == 0) {
      dup2(ends[1], STDOUT_FILENO);
      const std::string program = std::string(TUNNEL_PILOT_NODE_FOLDER) + "/status";
      execl(program.c_str(), program.c_str(), "__name:=status_of_the_test", nullptr);
      _exit(127);
    }
    close(ends[1]);
  }
  ~StatusProgram() {
    close(output_);
    kill(process_, SIGINT);
    waitpid(process_, nullptr, 0);
  }
  StatusProgram(const StatusProgram&) = delete;
  StatusProgram& operator=(const StatusProgram&) = delete;

  /// The lines that have come since the last call.
  std::vector<std::string> lines() {
    char buffer[4096];
    for (ssize_t n = 0; (n = read(output_, buffer, sizeof buffer)) > 0;) {
      pending_.append(buffer, static_cast<std::size_t>(n));
    }
    std::vector<std::string> complete;
    for (std::size_t end = 0; (end = pending_.find('\n')) != std::string::npos;) {
      complete.push_back(pending_.substr(0, end));
      pending_.erase(0, end + 1);
    }
    return complete;
  }

 private:
  int output_ = -1;
  pid_t process_ = -1;
  std::string pending_;
};

#ifdef TUNNEL_PILOT_HUD
/// What the HUD's display would paint: its topics, its library, its pace; no display.
class Hud {
 public:
  Hud() {
    listen("tunnel_state", input_.tunnel);
    listen("arbiter_state", input_.arbiter);
    listen("truck_status", input_.truck);
    listen("joint_states", input_.joints);
    listen("command", input_.command);
    listen("lidar_driver/proposal", input_.network);
    listen("preview_driver/proposal", input_.preview);
    listen("odom", input_.odometry);
  }

  /// The reason that is shown.
  const std::string& reason() {
    const auto now = ros::SteadyTime::now();
    if ((now - looked_).toSec() >= 1.0 / 15.0) {
      looked_ = now;
      reason_ = hud::describeHud(input_, {ros::Time::now(), now}).reason.text;
    }
    return reason_;
  }

 private:
  template <class Message>
  void listen(const std::string& topic, hud::Heard<Message>& heard) {
    const boost::function<void(const Message&)> hear = [&heard](const Message& message) {
      heard.set(message, {ros::Time::now(), ros::SteadyTime::now()});
    };
    subscribers_.push_back(nh_.subscribe<Message>(topic, 1, hear));
  }

  ros::NodeHandle nh_;
  hud::HudInput input_;
  std::vector<ros::Subscriber> subscribers_;
  ros::SteadyTime looked_;
  std::string reason_;
};
#endif

/// All that tells a reason, and when it did, in ROS time. look() again and again, callbacks served
/// between.
class Channels {
 public:
  using Delays = std::vector<std::pair<std::string, double>>;  ///< by channel [s]

  Channels() {
    hear<ArbiterState>("arbiter_state", [this](const ArbiterState& m) {
      hears_arbiter_ = true;
      arbiter_is_content_ = m.reason == static_cast<std::uint8_t>(supervision::Reason::kNone);
      given("arbiter", m.reason);
    });
    hear<TruckStatus>("truck_status", [this](const TruckStatus& m) {
      truck_ = m;
      given("can_bridge", m.reason);
    });
    hear<rosgraph_msgs::Log>("/rosout", [this](const rosgraph_msgs::Log& m) { onLog(m.msg); });
    hear<diagnostic_msgs::DiagnosticArray>("/diagnostics", [this](const auto& m) {
      for (const auto& told : m.status) onDiagnosis(told.name, told.message);
    });
  }

  /// From here on this reason is waited for, as found by one of these nodes.
  void listenFor(supervision::Reason reason, const std::vector<std::string>& finders) {
    reason_ = reason;
    words_ = toString(reason);
    finders_ = finders;
    stands_.reset();
    told_.clear();
  }

  void look() {
    for (const std::string& line : status_.lines()) {
      lately_["status"] = line;
      if (line.find(": " + words_ + " | ") != std::string::npos) tell("status");
    }
#ifdef TUNNEL_PILOT_HUD
    lately_["HUD"] = hud_.reason();
    if (hud_.reason() == words_) tell("HUD");
#endif
  }

  bool hearsArbiter() const { return hears_arbiter_; }
  bool arbiterIsContent() const { return arbiter_is_content_; }
  const TruckStatus& truck() const { return truck_; }

  /// The finder's own topic has given the reason since listenFor().
  bool stands() const { return stands_.has_value(); }
  double sinceItStands() const { return (ros::Time::now() - *stands_).toSec(); }
  bool allTold() const {
    const auto told = [this](const std::string& channel) { return told_.count(channel) > 0; };
    return std::all_of(channels().begin(), channels().end(), told);
  }

  /// Of each channel after stands(), infinite where it has not told; kept for printWorst().
  Delays takeDelays() {
    Delays delays;
    for (const std::string& channel : channels()) {
      const auto told = told_.find(channel);
      const double never = std::numeric_limits<double>::infinity();
      const double delay =
          told == told_.end() ? never : std::max(0.0, (told->second - *stands_).toSec());
      delays.emplace_back(channel, delay);
    }
    all_.emplace_back(reason_, delays);
    return delays;
  }

  /// What each channel said last.
  std::string lately() const {
    std::string text;
    for (const auto& [channel, words] : lately_) text += "  " + channel + ": " + words + "\n";
    return text;
  }

  void printWorst() const {
    std::map<std::string, double> worst;
    std::printf("  from the reason's topic to [s] ROS time\n");
    for (const auto& [reason, delays] : all_) {
      std::printf("  %2d", static_cast<int>(reason));
      for (const auto& [channel, delay] : delays) {
        std::printf("  %s %.3f", channel.c_str(), delay);
        worst[channel] = std::max(worst[channel], delay);
      }
      std::printf("  %s\n", toString(reason).c_str());
    }
    std::printf("  worst of %zu reasons:", all_.size());
    for (const auto& [channel, delay] : worst) std::printf("  %s %.3f s", channel.c_str(), delay);
    std::printf("\n");
  }

 private:
  static const std::vector<std::string>& channels() {
#ifdef TUNNEL_PILOT_HUD
    static const std::vector<std::string> all = {"HUD", "status", "diagnostics", "log"};
#else
    static const std::vector<std::string> all = {"status", "diagnostics", "log"};
#endif
    return all;
  }

  template <class Message>
  void hear(const std::string& topic, const std::function<void(const Message&)>& callback) {
    const boost::function<void(const Message&)> call = callback;
    subscribers_.push_back(nh_.subscribe<Message>(topic, 100, call));
  }

  void tell(const std::string& channel) { told_.emplace(channel, ros::Time::now()); }

  void given(const std::string& node, std::uint8_t reason) {
    const bool finds = std::find(finders_.begin(), finders_.end(), node) != finders_.end();
    if (finds && !stands_ && reason == static_cast<std::uint8_t>(reason_)) stands_ = ros::Time::now();
  }

  void onLog(const std::string& message) {
    for (const std::string& node : finders_) {
      if (message.rfind(node + ": ", 0) != 0) continue;
      lately_["log"] = message;
      if (endsWith(message, ": " + words_)) tell("log");
    }
  }

  void onDiagnosis(const std::string& name, const std::string& message) {
    for (const std::string& node : finders_) {
      if (!endsWith(name, ": " + node)) continue;
      lately_["diagnostics"] = message;
      if (message == words_ || endsWith(message, ": " + words_)) tell("diagnostics");
    }
  }

  ros::NodeHandle nh_;
  std::vector<ros::Subscriber> subscribers_;
  StatusProgram status_;
#ifdef TUNNEL_PILOT_HUD
  Hud hud_;
#endif
  bool hears_arbiter_ = false, arbiter_is_content_ = false;
  TruckStatus truck_;
  supervision::Reason reason_ = supervision::Reason::kNone;
  std::string words_ = "no reason yet";
  std::vector<std::string> finders_;
  std::optional<ros::Time> stands_;
  std::map<std::string, ros::Time> told_;
  std::map<std::string, std::string> lately_;
  std::vector<std::pair<supervision::Reason, Delays>> all_;
};

}  // namespace tunnel_pilot::shell
