#pragma once

#include <pcl/ModelCoefficients.h>
#include <pcl/filters/extract_indices.h>
#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/segmentation/sac_segmentation.h>

#include <optional>

namespace tunnel_pilot::benchmark {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

/// What PCL's chain costs hangs on these two.
struct PclSettings {
  float leaf;     ///< of the voxel grid [m]
  int neighbors;  ///< that the outlier removal looks at
};
constexpr PclSettings kTutorial{0.05F, 50};  ///< the neighbours as in PCL's own tutorial: its usual use
constexpr PclSettings kLight{0.1F, 10};      ///< about the least that does the work

inline Cloud::Ptr thinned(const Cloud::ConstPtr& cloud, const PclSettings& settings) {
  pcl::VoxelGrid<pcl::PointXYZ> voxels;
  voxels.setInputCloud(cloud);
  voxels.setLeafSize(settings.leaf, settings.leaf, settings.leaf);
  Cloud::Ptr out(new Cloud);
  voxels.filter(*out);
  return out;
}

inline Cloud::Ptr withoutOutliers(const Cloud::ConstPtr& cloud, const PclSettings& settings) {
  pcl::StatisticalOutlierRemoval<pcl::PointXYZ> outliers;
  outliers.setInputCloud(cloud);
  outliers.setMeanK(settings.neighbors);
  outliers.setStddevMulThresh(1.0);
  Cloud::Ptr out(new Cloud);
  outliers.filter(*out);
  return out;
}

/// The line that most points lie on, by RANSAC; its points are taken out of `rest`.
inline std::optional<pcl::ModelCoefficients> takeLine(Cloud::Ptr& rest) {
  pcl::SACSegmentation<pcl::PointXYZ> lines;
  lines.setModelType(pcl::SACMODEL_LINE);
  lines.setMethodType(pcl::SAC_RANSAC);
  lines.setDistanceThreshold(0.15);
  lines.setMaxIterations(100);
  lines.setInputCloud(rest);
  pcl::PointIndices::Ptr inliers(new pcl::PointIndices);
  pcl::ModelCoefficients line;
  lines.segment(*inliers, line);
  if (inliers->indices.empty()) return std::nullopt;
  pcl::ExtractIndices<pcl::PointXYZ> extract;
  extract.setInputCloud(rest);
  extract.setIndices(inliers);
  extract.setNegative(true);
  Cloud::Ptr left_over(new Cloud);
  extract.filter(*left_over);
  rest = left_over;
  return line;
}

}  // namespace tunnel_pilot::benchmark
