// Every parameter of every stage, spoilt in each way, refuses to start and names itself.
#include "tunnel_pilot/ros/parameters.h"

#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <sys/wait.h>

#include <cstdio>
#include <map>
#include <memory>

#include "../drivers/random_network.h"
#include "../neural/small_network.h"
#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/perception/wall_segmentation.h"
#include "tunnel_pilot/ros/arbiter_ros.h"
#include "tunnel_pilot/ros/bus_choice.h"
#include "tunnel_pilot/ros/can_bridge_ros.h"
#include "tunnel_pilot/ros/centerline_ros.h"
#include "tunnel_pilot/ros/lap_monitor.h"
#include "tunnel_pilot/ros/lidar_driver_ros.h"
#include "tunnel_pilot/ros/markers_ros.h"
#include "tunnel_pilot/ros/preview_driver_ros.h"
#include "tunnel_pilot/ros/scan_filter_ros.h"
#include "tunnel_pilot/ros/simulator_ros.h"
#include "tunnel_pilot/ros/wall_segmentation_ros.h"

namespace tunnel_pilot::shell {
namespace {

using XmlRpc::XmlRpcValue;

template <class Stage>
void start(const ros::NodeHandle& private_nh) {
  Stage stage(ros::NodeHandle("unheard"), private_nh);
}

struct StageCase {
  const char* name;  // of the parameters that the .test file loaded
  void (*start)(const ros::NodeHandle&);
};

const StageCase kStages[] = {
    {"scan_filter", start<ScanFilterRos>},   {"wall_segmentation", start<WallSegmentationRos>},
    {"centerline", start<CenterlineRos>},    {"preview_driver", start<PreviewDriverRos>},
    {"lidar_driver", start<LidarDriverRos>}, {"arbiter", start<ArbiterRos>},
    {"can_bridge", start<CanBridgeRos>},     {"simulator", start<SimulatorRos>},
    {"lap_monitor", start<LapMonitor>},      {"markers", start<MarkersRos>},
};

// The way to one value in a tree: keys and indices.
using Way = std::vector<std::string>;

void collect(const XmlRpcValue& tree, Way way, std::vector<Way>& ways) {
  if (tree.getType() == XmlRpcValue::TypeStruct) {
    for (const auto& entry : tree) {
      Way next = way;
      next.push_back(entry.first);
      collect(entry.second, next, ways);
    }
  } else if (tree.getType() == XmlRpcValue::TypeArray) {
    for (int i = 0; i < tree.size(); ++i) {
      Way next = way;
      next.push_back(std::to_string(i));
      collect(tree[i], next, ways);
    }
  } else {
    ways.push_back(way);
  }
}

XmlRpcValue& at(XmlRpcValue& tree, const Way& way) {
  XmlRpcValue* value = &tree;
  for (const std::string& part : way) {
    value = value->getType() == XmlRpcValue::TypeArray ? &(*value)[std::stoi(part)] : &(*value)[part];
  }
  return *value;
}

// The last name in a way: what a message must contain.
std::string keyOf(const Way& way) {
  for (auto part = way.rbegin(); part != way.rend(); ++part) {
    if (part->find_first_not_of("0123456789") != std::string::npos) return *part;
  }
  return "";
}

XmlRpcValue without(const XmlRpcValue& tree, const Way& way, std::size_t depth = 0) {
  if (tree.getType() == XmlRpcValue::TypeArray) {
    XmlRpcValue copy = tree;
    const int index = std::stoi(way[depth]);
    copy[index] = without(tree[index], way, depth + 1);
    return copy;
  }
  XmlRpcValue copy;
  copy.begin();  // makes it a map, even if it stays empty
  for (const auto& entry : tree) {
    if (entry.first != way[depth]) {
      copy[entry.first] = entry.second;
    } else if (depth + 1 < way.size()) {
      copy[entry.first] = without(entry.second, way, depth + 1);
    }
  }
  return copy;
}

class ParametersTest : public ::testing::TestWithParam<StageCase> {
 protected:
  ParametersTest() {
    nh_.getParam(GetParam().name, tree_);
    collect(tree_, {}, ways_);
  }

  // What the stage says to these parameters; empty when it starts.
  std::string refusal(const XmlRpcValue& tree) {
    const ros::NodeHandle private_nh("spoilt");
    private_nh.setParam(private_nh.getNamespace(), tree);
    try {
      GetParam().start(private_nh);
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "";
  }

  void expectRefused(const XmlRpcValue& tree, const Way& way, const std::string& how) {
    const std::string message = refusal(tree);
    EXPECT_NE(std::string::npos, message.find(keyOf(way)))
        << keyOf(way) << " " << how << ": " << message;
  }

  bool isNumber(const Way& way) {
    const auto type = at(tree_, way).getType();
    return type == XmlRpcValue::TypeDouble || type == XmlRpcValue::TypeInt;
  }

  void spoilNumbers(const XmlRpcValue& value, const std::string& how) {
    for (const Way& way : ways_) {
      if (!isNumber(way)) continue;
      XmlRpcValue spoilt = tree_;
      at(spoilt, way) = value;
      expectRefused(spoilt, way, how);
    }
  }

  ros::NodeHandle nh_;
  XmlRpcValue tree_;
  std::vector<Way> ways_;
};

TEST_P(ParametersTest, ShippedFileIsAccepted) {
  ASSERT_FALSE(ways_.empty());
  EXPECT_EQ("", refusal(tree_));
}

TEST_P(ParametersTest, UnknownKeyIsRefused) {
  XmlRpcValue spoilt = tree_;
  spoilt["no_such_key"] = 1;
  expectRefused(spoilt, {"no_such_key"}, "unknown");
}

TEST_P(ParametersTest, EachMissingKeyIsRefused) {
  for (const Way& way : ways_) {
    if (way.back().find_first_not_of("0123456789") == std::string::npos) continue;  // of a list
    expectRefused(without(tree_, way), way, "missing");
  }
}

TEST_P(ParametersTest, EachTextInPlaceOfANumberIsRefused) { spoilNumbers("1", "as text"); }

TEST_P(ParametersTest, EachFlagInPlaceOfANumberIsRefused) { spoilNumbers(true, "as a flag"); }

TEST_P(ParametersTest, EachNumberOutOfRangeIsRefused) {
  spoilNumbers(1e30, "huge");
  spoilNumbers(-1e30, "hugely negative");
}

TEST_P(ParametersTest, EachNumberThatIsNoneIsRefused) {
  spoilNumbers(std::numeric_limits<double>::quiet_NaN(), "NaN");
}

INSTANTIATE_TEST_SUITE_P(Stages, ParametersTest, ::testing::ValuesIn(kStages),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(BadParameters, NodeletIsNotLoaded) {
  nodelet::Loader loader(ros::NodeHandle("~loader"));
  EXPECT_TRUE(loader.load("/scan_filter", "tunnel_pilot/scan_filter", {}, {}));
  EXPECT_FALSE(loader.load("/without_parameters", "tunnel_pilot/scan_filter", {}, {}));
}

TEST(BadParameters, ANetworkByARelativePathOrABadOneIsRefused) {
  const ros::NodeHandle private_nh("spoilt_lidar_driver");
  XmlRpcValue tree;
  ros::NodeHandle().getParam("lidar_driver", tree);
  for (const auto& [file, told] :
       {std::pair("../networks/lidar_driver.yaml", "must be the absolute path"),
        std::pair("/nowhere/network.yaml", "does not exist"),
        std::pair(TUNNEL_PILOT_SOURCE_DIR "/config/truck.yaml", "is not a network file")}) {
    tree["network"] = file;
    private_nh.setParam(private_nh.getNamespace(), tree);
    try {
      start<LidarDriverRos>(private_nh);
      ADD_FAILURE() << file << " was accepted";
    } catch (const config::ConfigError& error) {
      EXPECT_NE(std::string::npos, std::string(error.what()).find(told)) << error.what();
    }
  }
}

std::string refusalOfBridge(const std::string& name, const std::map<std::string, std::string>& bus) {
  XmlRpcValue tree;
  ros::NodeHandle().getParam("can_bridge", tree);
  tree = without(tree, {"bus"});
  for (const auto& [key, value] : bus) tree[key] = value;
  const ros::NodeHandle private_nh(name);
  private_nh.setParam(private_nh.getNamespace(), tree);
  try {
    start<CanBridgeRos>(private_nh);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(BadParameters, ABridgeTakesOneBusAlone) {
  const std::string both = refusalOfBridge("two_buses", {{"bus", "embedded"}, {"interface", "can0"}});
  EXPECT_NE(std::string::npos, both.find("interface: there is a bus, too")) << both;
}

TEST(BadParameters, ABridgeRefusesAnUnknownProfile) {
  const std::string odd = refusalOfBridge("odd_profile", {{"bus", "embedded"}, {"profile", "canopen"}});
  EXPECT_NE(std::string::npos, odd.find("'profile'")) << odd;
}

TEST(BadParameters, ABridgeRefusesAnInterfaceThatNoneCanBe) {
  const std::string odd = refusalOfBridge("odd_interface", {{"interface", "can0; reboot"}});
  EXPECT_NE(std::string::npos, odd.find("'can0; reboot'")) << odd;
}

TEST(BadParameters, SimulatedTimeIsRefusedOnAnInterface) {
  const ros::NodeHandle private_nh("simulated_bus");
  private_nh.setParam("interface", "can0");
  Parameters parameters(private_nh);
  try {
    takeBus(parameters, true);
    ADD_FAILURE() << "accepted";
  } catch (const config::ConfigError& error) {
    EXPECT_NE(std::string::npos, std::string(error.what()).find("not driven in simulated time"))
        << error.what();
  }
}

class NodeTest : public ::testing::TestWithParam<const char*> {};

TEST_P(NodeTest, WithoutParametersEndsWithAnErrorStatusAndSaysWhy) {
  const std::string command = std::string("timeout 20 ") + TUNNEL_PILOT_NODE_FOLDER + "/" + GetParam() +
                              " __name:=nameless 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  ASSERT_NE(nullptr, pipe);
  std::string output;
  char buffer[1024];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) output += buffer;
  const int status = pclose(pipe);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(1, WEXITSTATUS(status));
  EXPECT_NE(std::string::npos, output.find("is missing")) << output;
}

INSTANTIATE_TEST_SUITE_P(Nodes, NodeTest,
                         ::testing::Values("arbiter", "can_bridge", "centerline", "lap_monitor",
                                           "lidar_driver", "markers", "preview_driver", "scan_filter",
                                           "simulator", "wall_segmentation"));

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "parameters_test");
  const ros::NodeHandle nh;
  const tunnel_pilot::neural::Folder folder;
  auto network = tunnel_pilot::drivers::randomNetwork();
  tunnel_pilot::neural::saveNetwork(folder.file("network.yaml"), network);
  nh.setParam("lidar_driver/network", folder.file("network.yaml"));
  return RUN_ALL_TESTS();
}
