#include "tunnel_pilot/drivers/preview_parameters.h"

#include <filesystem>

namespace tunnel_pilot::drivers {
namespace {

AdaptationParameters loadAdaptation(config::Node node) {
  AdaptationParameters adaptation{};
  adaptation.enabled = node.boolean("enabled");
  adaptation.rate = node.number("rate", "rad/m", 0.0, 1.0);
  adaptation.momentum = node.number("momentum", "1", 0.0, 0.99);
  adaptation.bound = node.number("bound", "rad", 0.0, 1.0);
  node.finish();
  return adaptation;
}

NetworkLawParameters loadNetworkLaw(config::Node node, const std::string& folder) {
  NetworkLawParameters law{};
  law.file = (std::filesystem::path(folder) / node.text("file")).lexically_normal().string();
  law.correction_time = node.number("correction_time", "s", 0.0, 2.0);
  law.least_pace = node.number("least_pace", "m/s", 0.1, 10.0);
  law.adaptation = loadAdaptation(node.child("adaptation"));
  node.finish();
  return law;
}

}  // namespace

PreviewWeights loadPreviewWeights(config::Node node) {
  PreviewWeights weights{};
  weights.offset = node.number("offset", "1/m^2", 1e-3, 1e3);
  weights.heading = node.number("heading", "1/rad^2", 0.0, 1e4);
  weights.slope = node.number("slope", "m^2/rad^2", 1e-2, 1e5);
  weights.slope_speed = node.number("slope_speed", "m/s", 0.1, 10.0);
  weights.terminal = node.number("terminal", "1", 1.0, 1e3);
  weights.rate_share = node.number("rate_share", "1", 0.3, 1.0);
  weights.sharp_speed = node.number("sharp_speed", "m/s", 0.1, 100.0);
  node.finish();
  return weights;
}

PreviewLaw readPreviewLaw(config::Node& node, const std::string& key) {
  return node.choice(key, {"optimal", "network"}) == "network" ? PreviewLaw::kNetwork
                                                               : PreviewLaw::kOptimal;
}

PreviewDriverParameters loadPreviewDriver(config::Node node, const std::string& folder,
                                          std::optional<PreviewLaw> law) {
  PreviewDriverParameters p{};
  p.law = readPreviewLaw(node, "law");
  p.law = law.value_or(p.law);
  p.speed = node.number("speed", "m/s", 0.1, 15.0);
  p.planning_speed = node.number("planning_speed", "m/s", 0.1, 3.0);
  p.preview_time = node.number("preview_time", "s", 0.1, 5.0);
  p.step = node.number("step", "s", 0.02, 0.5);
  p.weights = loadPreviewWeights(node.child("weights"));
  p.network_law = loadNetworkLaw(node.child("network"), folder);
  p.truck = loadPathPredictor(node);
  node.finish();
  if (p.law == PreviewLaw::kNetwork) {
    p.network = std::make_shared<neural::NetworkFile>(neural::loadNetwork(p.network_law.file));
  }
  return p;
}

}  // namespace tunnel_pilot::drivers
