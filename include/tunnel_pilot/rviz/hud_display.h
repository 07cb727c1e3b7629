#pragma once

#include <ros/subscriber.h>
#include <rviz/display.h>

#include <memory>
#include <vector>

#include "tunnel_pilot/rviz/hud_content.h"
#include "tunnel_pilot/rviz/overlay.h"

namespace rviz {
class EnumProperty;
class FloatProperty;
class RosTopicProperty;
}  // namespace rviz

namespace tunnel_pilot::hud {

/// The rviz display tunnel_pilot/Hud: what the truck does and why, in numbers, bars and words over the
/// scene. Subscribes `tunnel_state`, `arbiter_state`, `truck_status`, `joint_states`, `command`,
/// `lidar_driver/proposal`, `preview_driver/proposal` and `odom` (properties name others). Paints at
/// most 15 times a second, and only what differs from what is shown.
class HudDisplay : public rviz::Display {
  Q_OBJECT

 public:
  HudDisplay();
  ~HudDisplay() override;

  void update(float wall_dt, float ros_dt) override;
  void reset() override;

 protected:
  void onInitialize() override;
  void onEnable() override;
  void onDisable() override;

 private Q_SLOTS:
  void subscribe();

 private:
  template <class Message>
  void addTopic(const char* name, const char* topic, Heard<Message>& heard);
  template <class Message>
  void listen(const rviz::RosTopicProperty& topic, Heard<Message>& heard);
  void place(int view_width, int view_height);

  HudInput input_;
  std::vector<std::function<void()>> listeners_;
  std::vector<ros::Subscriber> subscribers_;
  rviz::EnumProperty* position_;
  rviz::FloatProperty* scale_;
  std::unique_ptr<Overlay> overlay_;
  HudContent shown_;
  double shown_scale_ = 0.0;  // 0: nothing is shown yet
  ros::SteadyTime looked_;
};

}  // namespace tunnel_pilot::hud
