#include "tunnel_pilot/vehicle/articulation.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::vehicle {
namespace {

// Corners of a body of the truck's width from x = `back` to x = `front` in its own frame.
std::vector<geometry::Point> rectangle(const geometry::Frame& frame, double back, double front,
                                       double width) {
  const double y = 0.5 * width;
  return {frame.transform({back, -y}), frame.transform({front, -y}), frame.transform({front, y}),
          frame.transform({back, y})};
}

}  // namespace

double yawRate(const TruckGeometry& truck, double speed, double articulation, double articulation_rate) {
  return (speed * std::sin(articulation) + truck.rear_axle_to_hinge * articulation_rate) /
         (truck.front_axle_to_hinge * std::cos(articulation) + truck.rear_axle_to_hinge);
}

double steadyCurvature(const TruckGeometry& truck, double articulation) {
  return std::sin(articulation) /
         (truck.front_axle_to_hinge * std::cos(articulation) + truck.rear_axle_to_hinge);
}

double steadyArticulation(const TruckGeometry& truck, double curvature) {
  // kappa (l_f cos(gamma) + l_r) = sin(gamma)  <=>  sin(gamma - atan(kappa l_f)) =
  // kappa l_r / sqrt(1 + (kappa l_f)^2)
  const double a = curvature * truck.front_axle_to_hinge;
  const double sine = curvature * truck.rear_axle_to_hinge / std::sqrt(1.0 + a * a);
  const double gamma = std::atan(a) + std::asin(std::clamp(sine, -1.0, 1.0));
  return std::clamp(gamma, -truck.max_articulation, truck.max_articulation);
}

double articulationSlope(const TruckGeometry& truck, double curvature, double articulation) {
  const double arm = truck.front_axle_to_hinge * std::cos(articulation) + truck.rear_axle_to_hinge;
  return (curvature * arm - std::sin(articulation)) / truck.rear_axle_to_hinge;
}

geometry::Frame rearFrame(const TruckGeometry& truck, const geometry::Frame& front,
                          double articulation) {
  const geometry::Frame hinge(front.compose({-truck.front_axle_to_hinge, 0.0, -articulation}));
  return hinge.shifted({-truck.rear_axle_to_hinge, 0.0});
}

geometry::Pose rearPose(const TruckGeometry& truck, const geometry::Pose& front, double articulation) {
  return rearFrame(truck, geometry::Frame(front), articulation).pose();
}

std::vector<geometry::Point> frontOutline(const TruckGeometry& truck, const geometry::Pose& front) {
  return rectangle(geometry::Frame(front), -truck.front_axle_to_hinge, truck.front_overhang,
                   truck.overall_width);
}

std::vector<geometry::Point> rearOutline(const TruckGeometry& truck, const geometry::Pose& front,
                                         double articulation) {
  return rectangle(rearFrame(truck, geometry::Frame(front), articulation), -truck.rear_overhang,
                   truck.rear_axle_to_hinge, truck.overall_width);
}

}  // namespace tunnel_pilot::vehicle
