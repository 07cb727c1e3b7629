#pragma once

#include <memory>
#include <optional>
#include <string>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/path_predictor.h"
#include "tunnel_pilot/drivers/preview_network.h"
#include "tunnel_pilot/drivers/preview_planner.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::drivers {

/// How a preview driver finds its command: by the optimal plan (PreviewDriver), or by the paper's
/// network (NeuralPreviewDriver).
enum class PreviewLaw { kOptimal, kNetwork };

/// What the law by the network needs.
struct NetworkLawParameters {
  std::string file;        ///< with the law by the plan, it is not read
  double correction_time;  ///< T_c, which makes up for the steering's lag [s]
  double least_pace;       ///< a slower truck is steered as at this one [m/s]
  AdaptationParameters adaptation;
};

/// What a preview driver believes of the truck, and how it weighs errors (config/preview_driver.yaml).
struct PreviewDriverParameters {
  PreviewLaw law;
  double speed;           ///< highest speed asked for [m/s]
  double planning_speed;  ///< lowest speed planned with, so that standing trucks may steer [m/s]
  double preview_time;    ///< T_p, of the network's preview and of the point shown [s]
  double step;            ///< of the plan; the horizon has PreviewPlanner::kStages of them [s]
  PreviewWeights weights;
  NetworkLawParameters network_law;
  PathPredictorParameters truck;
  std::shared_ptr<const neural::NetworkFile> network;  ///< of the law by it; otherwise none
};

/// Reads and checks a map of weights. Throws config::ConfigError.
PreviewWeights loadPreviewWeights(config::Node node);

/// Reads and checks config/preview_driver.yaml, and the network's file if it is to drive; a relative
/// file name is looked for from `folder`. A `law` given here takes the place of the file's. Throws
/// config::ConfigError.
PreviewDriverParameters loadPreviewDriver(config::Node node, const std::string& folder,
                                          std::optional<PreviewLaw> law = std::nullopt);

/// The law that a key names: optimal or network. Throws config::ConfigError.
PreviewLaw readPreviewLaw(config::Node& node, const std::string& key);

}  // namespace tunnel_pilot::drivers
