#include "tunnel_pilot/rviz/hud_display.h"

#include <OgreViewport.h>
#include <ros/names.h>
#include <ros/node_handle.h>
#include <rviz/display_context.h>
#include <rviz/properties/enum_property.h>
#include <rviz/properties/float_property.h>
#include <rviz/properties/ros_topic_property.h>
#include <rviz/render_panel.h>
#include <rviz/view_manager.h>

#include <algorithm>
#include <pluginlib/class_list_macros.hpp>

#include "tunnel_pilot/rviz/hud_painter.h"

namespace tunnel_pilot::hud {
namespace {

constexpr double kPeriod = 1.0 / 15.0;  // of looking whether something changed [s] steady time
constexpr int kEdge = 10;               // from the render window's edge [pixels]
enum Position { kBottom = 0, kTop = 1 };

}  // namespace

HudDisplay::HudDisplay() {
  position_ = new rviz::EnumProperty("Position", "Bottom", "At which edge of the view.", this);
  position_->addOption("Bottom", kBottom);
  position_->addOption("Top", kTop);
  scale_ = new rviz::FloatProperty("Scale", 1.0F, "Size; never wider than the view.", this);
  scale_->setMin(0.5F);
  scale_->setMax(4.0F);
  addTopic("Tunnel State", "tunnel_state", input_.tunnel);
  addTopic("Arbiter State", "arbiter_state", input_.arbiter);
  addTopic("Truck Status", "truck_status", input_.truck);
  addTopic("Joint States", "joint_states", input_.joints);
  addTopic("Command", "command", input_.command);
  addTopic("Network Proposal", "lidar_driver/proposal", input_.network);
  addTopic("Preview Proposal", "preview_driver/proposal", input_.preview);
  addTopic("Odometry", "odom", input_.odometry);
}

HudDisplay::~HudDisplay() = default;

template <class Message>
void HudDisplay::addTopic(const char* name, const char* topic, Heard<Message>& heard) {
  const auto* property = new rviz::RosTopicProperty(
      name, topic, ros::message_traits::datatype<Message>(),
      "Topic; relative names are in rviz' own namespace.", this, SLOT(subscribe()));
  listeners_.push_back([this, property, &heard] { listen(*property, heard); });
}

template <class Message>
void HudDisplay::listen(const rviz::RosTopicProperty& topic, Heard<Message>& heard) {
  heard = {};
  const boost::function<void(const boost::shared_ptr<const Message>&)> hear =
      [&heard](const boost::shared_ptr<const Message>& message) {
        heard.set(*message, {ros::Time::now(), ros::SteadyTime::now()});
      };
  try {
    subscribers_.push_back(update_nh_.subscribe<Message>(topic.getTopicStd(), 1, hear));
    setStatus(rviz::StatusProperty::Ok, topic.getName(), "subscribed");
  } catch (const ros::Exception& error) {
    setStatus(rviz::StatusProperty::Error, topic.getName(), error.what());
  }
}

void HudDisplay::subscribe() {
  subscribers_.clear();
  if (!initialized() || !isEnabled()) return;
  for (const auto& listener : listeners_) listener();
}

void HudDisplay::onInitialize() { overlay_ = std::make_unique<Overlay>(); }

void HudDisplay::onEnable() {
  shown_scale_ = 0.0;
  subscribe();
}

void HudDisplay::onDisable() {
  subscribers_.clear();
  overlay_->show(false);
}

void HudDisplay::reset() {
  Display::reset();
  input_ = {};
}

void HudDisplay::update(float /*wall_dt*/, float /*ros_dt*/) {
  const auto now = ros::SteadyTime::now();
  if ((now - looked_).toSec() < kPeriod) return;
  looked_ = now;
  const auto* view = context_->getViewManager()->getRenderPanel()->getViewport();
  if (view == nullptr) return;
  const int width = view->getActualWidth(), height = view->getActualHeight();
  const double widest = std::max(0.1, static_cast<double>(width - 2 * kEdge) / hudSize().width());
  const double scale = std::min<double>(scale_->getFloat(), widest);
  auto content = describeHud(input_, {ros::Time::now(), now});
  if (scale != shown_scale_ || !(content == shown_)) {
    overlay_->setImage(paintHud(content, scale));
    shown_ = std::move(content);
    shown_scale_ = scale;
    context_->queueRender();
  }
  place(width, height);
}

void HudDisplay::place(int view_width, int view_height) {
  const QSize size = hudSize() * shown_scale_;
  const int top =
      position_->getOptionInt() == kTop ? kEdge : std::max(0, view_height - kEdge - size.height());
  overlay_->place((view_width - size.width()) / 2, top);
  overlay_->show(true);
}

}  // namespace tunnel_pilot::hud

PLUGINLIB_EXPORT_CLASS(tunnel_pilot::hud::HudDisplay, rviz::Display)
