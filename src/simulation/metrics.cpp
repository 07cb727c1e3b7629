#include "tunnel_pilot/simulation/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace tunnel_pilot::simulation {
namespace {

constexpr double kDegrees = 57.29577951308232;
constexpr double kStandstill = 0.05;     // [m/s]
constexpr double kUnderWay = 0.5;        // from this speed on a standstill is a stop [m/s]
constexpr double kStraight = 1e-4;       // curvature below which a line is straight [1/m]
constexpr double kUnwinding = 10.0;      // three lengths l_r after a bend [m]
constexpr double kTurningIn = 3.0;       // steering begins before a bend, by its delays [m]
constexpr double kSettledOffset = 0.1;   // the paper's "returned" [m]
constexpr double kTightRadius = 16.0;    // [m]
constexpr double kTightestRadius = 8.0;  // [m]
constexpr double kNever = std::numeric_limits<double>::infinity();

const std::vector<MetricText>& metricTexts() {
  static const std::vector<MetricText> texts = {
      {"lateral_mean", "lateral offset, mean", "mm", 1e3},
      {"lateral_rms", "lateral offset, RMS", "m", 1.0},
      {"lateral_max", "lateral offset, largest", "m", 1.0},
      {"lateral_mean_left_bends", "lateral offset in bends to the left, mean", "mm", 1e3},
      {"lateral_mean_right_bends", "lateral offset in bends to the right, mean", "mm", 1e3},
      {"lateral_rms_left_bends", "lateral offset in bends to the left, RMS", "m", 1.0},
      {"lateral_rms_right_bends", "lateral offset in bends to the right, RMS", "m", 1.0},
      {"inside_mean", "offset to the inside of bends, mean", "mm", 1e3},
      {"heading_mean", "heading error, mean", "deg", kDegrees},
      {"heading_rms", "heading error, RMS", "deg", kDegrees},
      {"heading_rms_straights", "heading error on straights, RMS", "deg", kDegrees},
      {"articulation_std_straights", "articulation on straights, std", "deg", kDegrees},
      {"clearance_min", "wall clearance of either body, least", "m", 1.0},
      {"contacts", "wall contacts", "", 1.0},
      {"lidar_driver_share", "steered by lidar_driver", "%", 100.0},
      {"stops", "stops on the way", "", 1.0},
      {"completed", "way completed", "", 1.0},
      {"lap_time", "lap time", "s", 1.0},
      {"lap_efficiency", "the governor's ideal lap time over the lap time", "%", 100.0},
      {"speed_mean", "speed, mean", "m/s", 1.0},
      {"speed_max_straights", "speed on straights, largest", "m/s", 1.0},
      {"distance", "distance driven", "m", 1.0},
      {"heading_zero_time", "heading first zero after", "s", 1.0},
      {"settle_time", "offset below 0.1 m for good after", "s", 1.0},
      {"overshoot", "overshoot beyond the centre", "m", 1.0},
      {"path_error_max", "distance from the path, largest", "m", 1.0},
      {"path_error_rms", "distance from the path, RMS", "m", 1.0},
      {"lateral_acceleration_max", "lateral acceleration, largest", "m/s2", 1.0},
      {"articulation_max", "articulation, largest", "deg", kDegrees},
      {"articulation_rate_max", "articulation rate, largest", "deg/s", kDegrees},
      {"turn_time", "time for the turn", "s", 1.0},
      {"turn_radius", "radius of the turn", "m", 1.0},
      {"lateral_acceleration", "lateral acceleration, mean", "m/s2", 1.0},
      {"valid_share", "scans answered", "%", 100.0},
      {"tight_heading_median", "heading error in R 8-16 m, median", "deg", kDegrees},
      {"tight_heading_p95", "heading error in R 8-16 m, p95", "deg", kDegrees},
      {"gentle_heading_median", "heading error in wider bends, median", "deg", kDegrees},
      {"gentle_heading_p95", "heading error in wider bends, p95", "deg", kDegrees},
      {"straight_heading_median", "heading error on straights, median", "deg", kDegrees},
      {"straight_heading_p95", "heading error on straights, p95", "deg", kDegrees},
      {"offset_error_median", "lateral offset error, median", "m", 1.0},
      {"offset_error_p95", "lateral offset error, p95", "m", 1.0},
      {"width_error_median", "width error, median", "m", 1.0},
      {"width_error_p95", "width error, p95", "m", 1.0},
  };
  return texts;
}

// Mean, mean square and largest magnitude of a sequence.
struct Moments {
  double sum = 0.0;
  double squares = 0.0;
  double largest = 0.0;
  std::size_t count = 0;

  void add(double value) {
    sum += value;
    squares += value * value;
    largest = std::max(largest, std::abs(value));
    ++count;
  }
  double mean() const { return count == 0 ? 0.0 : sum / static_cast<double>(count); }
  double rms() const { return count == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(count)); }
  double deviation() const { return std::sqrt(std::max(0.0, rms() * rms() - mean() * mean())); }
};

bool isStraight(const geometry::Path& line, double station) {
  return !line.empty() && std::abs(line.at(station).curvature) < kStraight;
}

bool isSettledStraight(const geometry::Path& line, double station) {
  return isStraight(line, station - kUnwinding) && isStraight(line, station) &&
         isStraight(line, station + kTurningIn);
}

// How often the truck came to a standstill on its way.
int stopsIn(const std::vector<TrackSample>& track) {
  int stops = 0;
  bool under_way = false;
  for (const TrackSample& sample : track) {
    const double speed = std::abs(sample.speed);
    if (under_way && speed < kStandstill) ++stops;
    under_way = speed > kUnderWay || (under_way && speed >= kStandstill);
  }
  return stops;
}

// The offsets by the side to which the line bends.
Metrics bendMetrics(const std::vector<TrackSample>& track) {
  Moments left, right, inside;
  for (const TrackSample& sample : track) {
    if (std::abs(sample.speed) < kStandstill || std::abs(sample.curvature) < kStraight) continue;
    const bool to_the_left = sample.curvature > 0.0;
    (to_the_left ? left : right).add(sample.lateral_offset);
    inside.add(to_the_left ? sample.lateral_offset : -sample.lateral_offset);
  }
  Metrics metrics;
  if (left.count > 0) {
    metrics["lateral_mean_left_bends"] = left.mean();
    metrics["lateral_rms_left_bends"] = left.rms();
  }
  if (right.count > 0) {
    metrics["lateral_mean_right_bends"] = right.mean();
    metrics["lateral_rms_right_bends"] = right.rms();
  }
  if (inside.count > 0) metrics["inside_mean"] = inside.mean();
  return metrics;
}

std::string classOfBend(double curvature) {
  if (std::abs(curvature) < kStraight) return "straight";
  const double radius = 1.0 / std::abs(curvature);
  if (radius > kTightRadius + 1e-6) return "gentle";
  return radius < kTightestRadius - 1e-6 ? "tighter" : "tight";
}

}  // namespace

bool isMetric(const std::string& key) {
  const auto& texts = metricTexts();
  return std::any_of(texts.begin(), texts.end(),
                     [&](const MetricText& text) { return text.key == key; });
}

const MetricText& metricText(const std::string& key) {
  for (const MetricText& text : metricTexts()) {
    if (text.key == key) return text;
  }
  throw std::out_of_range("no metric is called '" + key + "'");
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  if (values[below] == values[above]) return values[below];  // also keeps inf - inf out
  return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
}

Metrics driveMetrics(const std::vector<TrackSample>& track, const geometry::Path& line) {
  Moments lateral, heading, heading_straight, speed;
  std::map<int, Moments>
      hinge;  // by straight: each has a mean of its own, by the sensor's bias and slip
  double clearance = std::numeric_limits<double>::infinity();
  bool settled = false;
  int straight = 0;
  double fastest_straight = 0.0;
  for (const TrackSample& sample : track) {
    clearance = std::min(clearance, sample.clearance);
    if (std::abs(sample.speed) < kStandstill) continue;
    lateral.add(sample.lateral_offset);
    heading.add(sample.heading_error);
    speed.add(sample.speed);
    if (isStraight(line, sample.station)) {
      heading_straight.add(sample.heading_error);
      fastest_straight = std::max(fastest_straight, sample.speed);
    }
    const bool was_settled = settled;
    settled = isSettledStraight(line, sample.station);
    if (settled && !was_settled) ++straight;
    if (settled) hinge[straight].add(sample.articulation);
  }
  Moments wobble;  // pooled within the straights
  for (const auto& [index, moments] : hinge) {
    wobble.squares += moments.deviation() * moments.deviation() * static_cast<double>(moments.count);
    wobble.count += moments.count;
  }
  Metrics metrics = bendMetrics(track);
  metrics.merge(
      Metrics{{"lateral_mean", lateral.mean()},
              {"lateral_rms", lateral.rms()},
              {"lateral_max", lateral.largest},
              {"heading_mean", heading.mean()},
              {"heading_rms", heading.rms()},
              {"heading_rms_straights", heading_straight.rms()},
              {"articulation_std_straights", wobble.rms()},
              {"clearance_min", clearance},
              {"speed_mean", speed.mean()},
              {"speed_max_straights", fastest_straight},
              {"stops", static_cast<double>(stopsIn(track))},
              {"distance", track.empty() ? 0.0 : track.back().station - track.front().station}});
  return metrics;
}

Metrics returnMetrics(const std::vector<TrackSample>& track) {
  Metrics metrics{{"heading_zero_time", kNever}, {"settle_time", kNever}, {"overshoot", 0.0}};
  if (track.empty()) return metrics;
  const double heading_sign = track.front().heading_error < 0.0 ? -1.0 : 1.0;
  const double offset_sign = track.front().lateral_offset < 0.0 ? -1.0 : 1.0;
  double settled_since = kNever;
  for (const TrackSample& sample : track) {
    const double time = sample.time - track.front().time;
    if (sample.heading_error * heading_sign <= 0.0) {
      metrics["heading_zero_time"] = std::min(metrics["heading_zero_time"], time);
    }
    if (std::abs(sample.lateral_offset) >= kSettledOffset) {
      settled_since = kNever;
    } else {
      settled_since = std::min(settled_since, time);
    }
    metrics["overshoot"] = std::max(metrics["overshoot"], -sample.lateral_offset * offset_sign);
  }
  metrics["settle_time"] = settled_since;
  return metrics;
}

Metrics pathMetrics(const std::vector<TrackSample>& track) {
  Moments error, acceleration, articulation, rate;
  for (std::size_t i = 0; i < track.size(); ++i) {
    error.add(track[i].lateral_offset);
    acceleration.add(track[i].lateral_acceleration);
    articulation.add(track[i].articulation);
    if (i == 0) continue;
    const double dt = track[i].time - track[i - 1].time;
    if (dt > 0.0) rate.add((track[i].articulation - track[i - 1].articulation) / dt);
  }
  return {{"path_error_max", error.largest},
          {"path_error_rms", error.rms()},
          {"lateral_acceleration_max", acceleration.largest},
          {"articulation_max", articulation.largest},
          {"articulation_rate_max", rate.largest}};
}

// The turn is measured as the paper does: by its time. The radius is that of the front axle's way,
// distance over angle, and the lateral acceleration the mean felt there.
Metrics steadyTurnMetrics(const std::vector<TrackSample>& track, double settled, double angle) {
  const auto first = std::find_if(track.begin(), track.end(),
                                  [&](const TrackSample& sample) { return sample.time >= settled; });
  if (first == track.end() || std::next(first) == track.end()) {
    throw std::invalid_argument("the turn was not recorded long enough to settle");
  }
  double turned = 0.0;
  double distance = 0.0;
  double duration = kNever;
  Moments lateral;
  for (auto sample = std::next(first); sample != track.end(); ++sample) {
    const auto before = std::prev(sample);
    const double step = geometry::wrapAngle(sample->front.heading - before->front.heading);
    const double dt = sample->time - before->time;
    if (duration == kNever && std::abs(turned + step) >= angle) {
      duration = before->time - first->time + dt * (angle - std::abs(turned)) / std::abs(step);
    }
    turned += step;
    distance += (sample->front.position() - before->front.position()).norm();
    lateral.add(std::abs(sample->lateral_acceleration));
  }
  return {{"turn_time", duration},
          {"turn_radius", distance / std::abs(turned)},
          {"lateral_acceleration", lateral.mean()}};
}

Metrics perceptionMetrics(const std::vector<PerceptionSample>& samples) {
  std::map<std::string, std::vector<double>> heading{{"tight", {}}, {"gentle", {}}, {"straight", {}}};
  std::vector<double> offset, width;
  for (const PerceptionSample& sample : samples) {
    if (!sample.valid) continue;
    heading[classOfBend(sample.curvature)].push_back(std::abs(sample.heading_error));
    offset.push_back(std::abs(sample.offset_error));
    width.push_back(std::abs(sample.width_error));
  }
  Metrics metrics;
  const auto count = static_cast<double>(std::max<std::size_t>(samples.size(), 1));
  metrics["valid_share"] = static_cast<double>(offset.size()) / count;
  for (const std::string bend : {"tight", "gentle", "straight"}) {
    if (heading[bend].empty()) continue;
    metrics[bend + "_heading_median"] = quantile(heading[bend], 0.5);
    metrics[bend + "_heading_p95"] = quantile(heading[bend], 0.95);
  }
  metrics["offset_error_median"] = quantile(offset, 0.5);
  metrics["offset_error_p95"] = quantile(offset, 0.95);
  metrics["width_error_median"] = quantile(width, 0.5);
  metrics["width_error_p95"] = quantile(width, 0.95);
  return metrics;
}

}  // namespace tunnel_pilot::simulation
