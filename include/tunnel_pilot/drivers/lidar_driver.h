#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/scan_domain.h"
#include "tunnel_pilot/drivers/steering_estimator.h"
#include "tunnel_pilot/drivers/watched_inference.h"
#include "tunnel_pilot/geometry/scan.h"
#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::drivers {

/// config/lidar_driver.yaml.
struct LidarDriverParameters {
  std::string network;  ///< file
  double speed;         ///< highest speed asked for [m/s]
  double max_scan_age;  ///< an older scan is not driven on [s]
  bool mirror;          ///< also asks the network about the scan's mirror image, and averages
  double sure;          ///< confidence below which a scan is bridged with the last sure answer [1]
  double bridge_time;   ///< ... for so long [s]
  SteeringEstimatorParameters steering;
};

/// What a network may be told of the truck beside the scan.
struct TruckInputs {
  double articulation = 0.0;        ///< measured, freed of the sensor's bias [rad]
  double articulation_ahead = 0.0;  ///< when a command given now begins to act [rad]
  double speed = 0.0;               ///< [m/s]
  double yaw_gain = 1.0;            ///< g of YawObserver [1]
  double yaw_disturbance = 0.0;     ///< d of YawObserver [1/m]
  double steering_rate = 0.25;      ///< SteeringEstimator::maxRate() [rad/s]
};

/// Reads and checks config/lidar_driver.yaml; a relative file name is looked for from `folder`. Throws
/// config::ConfigError.
LidarDriverParameters loadLidarDriver(config::Node node, const std::string& folder);

/// The inputs of a network that steers by a scan, scaled as its file says. Gaps in the ranges are
/// bridged in 1/r, in which walls are straight lines.
class LidarInputs {
 public:
  static constexpr std::size_t kBeams = 761;

  /// Throws config::ConfigError for inputs that a lidar driver does not have.
  LidarInputs(const std::vector<neural::InputGroup>& groups, const std::string& source);

  std::size_t size() const { return size_; }
  /// Fills `inputs` (size() values). False when a number is not finite or the scan has other than kBeams
  /// ranges or none that is usable.
  bool fill(const std::vector<float>& ranges, const TruckInputs& truck, float* inputs);

  /// The inputs of the last scan's mirror image, left for right.
  void fillMirrored(float* inputs) const;

  /// 1/r of the last scan's beams, gaps bridged [1/m].
  const std::vector<float>& inverse() const { return inverse_; }

 private:
  template <typename Iterator>
  void write(Iterator first, Iterator last, const TruckInputs& truck, float* inputs) const;

  std::vector<neural::InputGroup> groups_;
  std::size_t size_ = 0;
  std::vector<float> inverse_;
  TruckInputs truck_;
};

/// Steers by a network from the scan to the articulation (paper 000: 761-5-31 and its successors). A
/// scan that the network is not sure of (a cloud of dust before the lidar) is bridged for a moment with
/// the last sure answer. The confidence of its proposals is that of the decoded outputs, lowered for
/// scans unlike those of the training where the network's file tells their domain (ScanDomain).
class LidarDriver {
 public:
  /// Why the last proposal is not valid.
  enum class Refusal : std::uint8_t {
    kNone,
    kScanAge,    ///< too old, or from the future
    kMotion,     ///< not finite
    kScan,       ///< no 761 beams, or none with a return
    kOutputs,    ///< not finite or out of range
    kGivenUp,    ///< that again and again
    kCorrupted,  ///< the network's parameters in memory
    kNoBell,     ///< no output is high enough to be decoded
  };

  /// Throws config::ConfigError when the network's inputs, outputs or domain are not those of a lidar
  /// driver.
  LidarDriver(const LidarDriverParameters& parameters, const vehicle::TruckGeometry& geometry,
              const neural::NetworkFile& network);

  /// `scan` is the filter's network scan, `motion` the newest feedback; both at or before `now`.
  Proposal propose(const geometry::Scan& scan, const Motion& motion, Stamp now);
  /// Forgets commands, what was learned of the truck, and refused outputs.
  void reset();

  Refusal refusal() const { return refusal_; }

  const std::vector<float>& outputs() const { return outputs_; }  ///< of the last scan
  /// What the outputs stand for; none for a network with the articulation as its only output.
  const std::optional<neural::GaussianCode>& code() const { return code_; }
  const TruckInputs& truckInputs() const { return truck_; }  ///< at the last scan
  const std::string& model() const { return model_; }        ///< name and hash

 private:
  friend struct LidarDriverAccess;  // a test that spoils parameters

  /// What the network says of a scan.
  struct Answer {
    double articulation = 0.0;  ///< to demand [rad]
    double confidence = 0.0;    ///< 0..1
  };

  Refusal steer(const geometry::Scan& scan, const Motion& motion, Stamp now, Proposal& proposal);
  Refusal ask(Stamp now);
  std::optional<Answer> decode() const;
  Answer bridged(const Answer& answer, Stamp stamp);
  /// Of the lead l before the articulation ahead what is commanded [rad]: l (s + (1 - s) min(1, |l|/L)),
  /// s the network's small_lead_share, L SteeringEstimatorParameters::lead.
  double softened(double lead) const;

  LidarDriverParameters parameters_;
  LidarInputs inputs_;
  WatchedInference inference_;
  neural::OutputGroup output_;
  std::optional<neural::GaussianCode> code_;  ///< none: one output, the articulation itself
  std::optional<ScanDomain> domain_;
  SteeringEstimator steering_;
  TruckInputs truck_;
  Refusal refusal_ = Refusal::kScanAge;
  std::string model_;
  std::vector<float> values_;
  std::vector<float> outputs_;
  std::vector<float> mirrored_;
  Answer last_sure_;
  std::optional<Stamp> last_sure_stamp_;  ///< of its scan
};

/// In words an operator understands.
std::string toString(LidarDriver::Refusal refusal);

}  // namespace tunnel_pilot::drivers
