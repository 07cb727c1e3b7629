#pragma once

#include <vector>

#include "tunnel_pilot/geometry/pose.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// Kinematics of centre articulation without slip (Corke & Ridley 2001; the paper's equation 2):
/// yaw rate = (v sin(gamma) + l_r gamma_dot) / (l_f cos(gamma) + l_r) [rad/s].
double yawRate(const TruckGeometry& truck, double speed, double articulation, double articulation_rate);

/// Curvature of the front axle's path in steady turning, sin(gamma) / (l_f cos(gamma) + l_r) [1/m].
double steadyCurvature(const TruckGeometry& truck, double articulation);

/// Articulation that turns steadily with this curvature, limited to the mechanical stop [rad].
double steadyArticulation(const TruckGeometry& truck, double curvature);

/// Exact curvature inversion: for the front axle to follow curvature kappa(s),
/// d(gamma)/ds = [kappa (l_f cos(gamma) + l_r) - sin(gamma)] / l_r [rad/m].
double articulationSlope(const TruckGeometry& truck, double curvature, double articulation);

/// The rear body's frame (middle of the rear axle, rear heading).
geometry::Frame rearFrame(const TruckGeometry& truck, const geometry::Frame& front, double articulation);
geometry::Pose rearPose(const TruckGeometry& truck, const geometry::Pose& front, double articulation);

/// Outline of the front and the rear body as closed polygons, counter-clockwise, in the frame that
/// `front` is given in (four corners each).
std::vector<geometry::Point> frontOutline(const TruckGeometry& truck, const geometry::Pose& front);
std::vector<geometry::Point> rearOutline(const TruckGeometry& truck, const geometry::Pose& front,
                                         double articulation);

}  // namespace tunnel_pilot::vehicle
