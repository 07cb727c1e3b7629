#pragma once

#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/LaserScan.h>

#include <functional>
#include <string>
#include <vector>

#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/geometry/scan.h"

// What the programs that read bags share.
namespace tunnel_pilot::tools {

inline constexpr int kDone = 0;
inline constexpr int kBadInput = 2;

/// The package's own parameter files: beside the build or in the install space this program stands in.
/// Throws std::runtime_error when there are none.
std::string defaultConfig();

/// The perception's parameter files of the package, but for those that `folder` has, in the order of
/// simulation::perceptionFiles(). Throws std::runtime_error for a folder with none of them.
std::vector<std::string> perceptionFilesFrom(const std::string& folder);

/// The topics of a type, sorted.
std::vector<std::string> topicsOfType(const rosbag::Bag& bag, const std::string& type);

/// Some bags name their topics with the leading slash, some without.
bool sameTopic(const std::string& a, const std::string& b);

/// The scans' topic: the wanted one; if none is wanted, the only one or `scan`. Throws
/// std::runtime_error when there is none or several to choose from.
std::string scanTopic(const rosbag::Bag& bag, const std::string& wanted);

Stamp stampOf(const std_msgs::Header& header);
geometry::Scan scanOf(const sensor_msgs::LaserScan& message);
/// Without the articulation, which odometry does not tell.
drivers::Motion motionOf(const nav_msgs::Odometry& message);

/// A bag's own sizes are not to be trusted: this process gets no more than 4 GiB from now on.
void limitMemory();

/// Runs `work` in a process of its own and returns its answer: a damaged bag can end a process inside
/// the bag library (assertions, reads out of bounds). Exceptions of `work` and such an end are told on
/// the error stream behind `who`, and give kBadInput.
int runGuarded(const std::string& who, const std::function<int()>& work);

}  // namespace tunnel_pilot::tools
