#include "episode_plots.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "tunnel_pilot/simulation/chart.h"
#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::simulation {
namespace {

using geometry::Point;
using Images = std::vector<cv::Mat>;
using Value = std::function<double(const TrackSample&)>;

constexpr double kDegrees = 57.29577951308232;
constexpr int kWidth = 1400;        // [pixels]
constexpr int kStripHeight = 240;   // [pixels]
constexpr double kSweptStep = 0.5;  // outlines drawn every so far along the way [m]

std::vector<Point> curve(const std::vector<TrackSample>& track, const Value& x, const Value& y) {
  std::vector<Point> points;
  points.reserve(track.size());
  for (const TrackSample& sample : track) points.emplace_back(x(sample), y(sample));
  return points;
}

double station(const TrackSample& sample) { return sample.station; }

// One quantity over the distance along the reference line.
cv::Mat strip(const std::vector<TrackSample>& track, const std::string& title, const std::string& label,
              const Value& value, double least_range) {
  Chart chart(title, "distance along the line [m]", label);
  chart.line(curve(track, station, value), colour::kBlue, "", 1.6);
  chart.includeY(-least_range, least_range);
  return chart.draw(kWidth, kStripHeight);
}

// The truck's outlines along its way: what its bodies swept.
void addSwept(Chart& chart, const std::vector<TrackSample>& track, const vehicle::TruckGeometry& truck) {
  double next = -std::numeric_limits<double>::infinity();
  double way = 0.0;
  for (std::size_t i = 0; i < track.size(); ++i) {
    if (i > 0) way += (track[i].front.position() - track[i - 1].front.position()).norm();
    if (way < next) continue;
    next = way + kSweptStep;
    chart.area(vehicle::rearOutline(truck, track[i].front, track[i].articulation), colour::kPaleBlue);
    chart.area(vehicle::frontOutline(truck, track[i].front), colour::kPaleBlue, i == 0 ? "swept" : "");
  }
}

void addBody(Chart& chart, std::vector<Point> outline, const cv::Scalar& colour) {
  chart.area(outline, colour);
  outline.push_back(outline.front());
  chart.line(std::move(outline), colour::kInk, "", 1.2);
}

// Where the truck came to in the end.
void addTruck(Chart& chart, const TrackSample& sample, const vehicle::TruckGeometry& truck) {
  addBody(chart, vehicle::rearOutline(truck, sample.front, sample.articulation), colour::kPaleOrange);
  addBody(chart, vehicle::frontOutline(truck, sample.front), colour::kPaleYellow);
}

std::vector<Point> linePoints(const geometry::Path& line) {
  std::vector<Point> points;
  for (const geometry::PathPoint& p : line.points()) points.emplace_back(p.x, p.y);
  return points;
}

cv::Mat topView(const EpisodeResult& episode, const vehicle::TruckGeometry& truck,
                const std::string& title, bool swept) {
  Chart chart(title, "x [m]", "y [m]");
  chart.equalAxes();
  if (swept) addSwept(chart, episode.track, truck);
  for (std::size_t i = 0; i < episode.walls.size(); ++i) {
    chart.line(episode.walls[i], colour::kInk, i == 0 ? "walls" : "", 1.6);
  }
  if (!episode.line.empty()) chart.line(linePoints(episode.line), colour::kGrey, "reference line", 1.0);
  chart.line(
      curve(
          episode.track, [](const auto& s) { return s.rear.x; }, [](const auto& s) { return s.rear.y; }),
      colour::kOrange, "rear axle", 1.2);
  chart.line(curve(
                 episode.track, [](const auto& s) { return s.front.x; },
                 [](const auto& s) { return s.front.y; }),
             colour::kBlue, "front axle", 1.2);
  if (!episode.track.empty()) addTruck(chart, episode.track.back(), truck);
  // As high as the way's shape asks for.
  Point low = Point::Constant(std::numeric_limits<double>::infinity());
  Point high = -low;
  for (const TrackSample& sample : episode.track) {
    low = low.cwiseMin(sample.front.position());
    high = high.cwiseMax(sample.front.position());
  }
  const Point extent = (high - low).cwiseMax(1.0) + Point::Constant(14.0);
  const double height = 100.0 + (kWidth - 104.0) * extent.y() / extent.x();
  return chart.draw(kWidth, static_cast<int>(std::clamp(height, 340.0, 1000.0)));
}

cv::Mat articulationStrip(const std::vector<TrackSample>& track) {
  Chart chart("Articulation", "distance along the line [m]", "angle [deg]");
  chart.line(curve(track, station, [](const auto& s) { return s.articulation_command * kDegrees; }),
             colour::kOrange, "demanded", 1.4);
  chart.line(curve(track, station, [](const auto& s) { return s.articulation * kDegrees; }),
             colour::kBlue, "reached", 1.4);
  chart.includeY(-5.0, 5.0);
  return chart.draw(kWidth, kStripHeight);
}

cv::Mat offsetStrip(const std::vector<TrackSample>& track) {
  return strip(
      track, "Lateral offset of the front axle, left positive", "offset [m]",
      [](const auto& s) { return s.lateral_offset; }, 0.1);
}

cv::Mat headingStrip(const std::vector<TrackSample>& track) {
  return strip(
      track, "Heading error", "heading [deg]", [](const auto& s) { return s.heading_error * kDegrees; },
      1.0);
}

Images driveImages(const std::string& title, const EpisodeResult& episode,
                   const vehicle::TruckGeometry& truck) {
  const auto& track = episode.track;
  Chart speed("Speed", "distance along the line [m]", "speed [m/s]");
  speed.line(curve(track, station, [](const auto& s) { return s.speed; }), colour::kBlue, "", 1.6);
  speed.includeY(0.0, 1.0);
  Chart clearance("Clearance of either body to the walls", "distance along the line [m]",
                  "clearance [m]");
  clearance.line(curve(track, station, [](const auto& s) { return s.clearance; }), colour::kBlue, "",
                 1.6);
  clearance.line({{track.front().station, 0.2}, {track.back().station, 0.2}}, colour::kRed,
                 "envelope margin 0.20 m", 1.2);
  clearance.includeY(0.0, 0.5);
  return {topView(episode, truck, title, true),
          offsetStrip(track),
          headingStrip(track),
          articulationStrip(track),
          speed.draw(kWidth, kStripHeight),
          clearance.draw(kWidth, kStripHeight)};
}

Images steadyTurnImages(const std::string& title, const EpisodeResult& episode,
                        const vehicle::TruckGeometry& truck) {
  const auto& track = episode.track;
  const auto time = [](const TrackSample& s) { return s.time; };
  Chart yaw("Heading turned", "time [s]", "heading [deg]");
  std::vector<Point> turned;
  double heading = 0.0;
  for (std::size_t i = 0; i < track.size(); ++i) {
    if (i > 0) heading += geometry::wrapAngle(track[i].front.heading - track[i - 1].front.heading);
    turned.emplace_back(track[i].time, heading * kDegrees);
  }
  yaw.line(turned, colour::kBlue);
  Chart acceleration("Lateral acceleration", "time [s]", "a_y [m/s2]");
  acceleration.line(curve(track, time, [](const auto& s) { return s.lateral_acceleration; }),
                    colour::kBlue, "", 1.2);
  acceleration.includeY(0.0, 0.5);
  return {topView(episode, truck, title, false), yaw.draw(kWidth, 320),
          acceleration.draw(kWidth, kStripHeight)};
}

Images laneChangeImages(const std::string& title, const EpisodeResult& episode,
                        const vehicle::TruckGeometry& truck) {
  return {topView(episode, truck, title, false), offsetStrip(episode.track), headingStrip(episode.track),
          articulationStrip(episode.track)};
}

Images perceptionImages(const std::string& title, const EpisodeResult& episode,
                        const vehicle::TruckGeometry& truck) {
  const auto errors = [&](const std::string& name, const std::string& label, double factor,
                          double PerceptionSample::*member, double least_range) {
    Chart chart(name, "distance along the line [m]", label);
    std::vector<Point> points;
    const double gap = std::numeric_limits<double>::quiet_NaN();
    for (const PerceptionSample& s : episode.perception) {
      points.emplace_back(s.station, s.valid ? s.*member * factor : gap);
    }
    chart.line(std::move(points), colour::kBlue, "", 1.2);
    chart.includeY(-least_range, least_range);
    return chart.draw(kWidth, kStripHeight);
  };
  Chart bend("Curvature of the design line", "distance along the line [m]", "curvature [1/m]");
  std::vector<Point> curvature;
  for (const PerceptionSample& s : episode.perception) curvature.emplace_back(s.station, s.curvature);
  bend.line(std::move(curvature), colour::kOrange, "", 1.6);
  return {topView(episode, truck, title, false), bend.draw(kWidth, kStripHeight),
          errors("Heading: measured less true", "error [deg]", kDegrees,
                 &PerceptionSample::heading_error, 2.0),
          errors("Lateral offset: measured less true", "error [m]", 1.0, &PerceptionSample::offset_error,
                 0.05),
          errors("Width: measured less true", "error [m]", 1.0, &PerceptionSample::width_error, 0.1)};
}

}  // namespace

std::string episodePicture(const Scenario& scenario, const EpisodeResult& episode,
                           const vehicle::TruckGeometry& truck) {
  if (episode.track.empty()) return "";
  const std::string title = scenario.name + ", " + episode.label();
  const auto images = [&]() -> Images {
    if (std::holds_alternative<DriveExperiment>(scenario.experiment))
      return driveImages(title, episode, truck);
    if (std::holds_alternative<SteadyTurnExperiment>(scenario.experiment))
      return steadyTurnImages(title, episode, truck);
    if (std::holds_alternative<LaneChangeExperiment>(scenario.experiment))
      return laneChangeImages(title, episode, truck);
    return perceptionImages(title, episode, truck);
  };
  return toPng(images());
}

}  // namespace tunnel_pilot::simulation
