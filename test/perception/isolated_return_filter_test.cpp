#include "tunnel_pilot/perception/isolated_return_filter.h"

#include <gtest/gtest.h>

#include <limits>

namespace tunnel_pilot::perception {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZI>;
using Filter = IsolatedReturnFilter<pcl::PointXYZI>;

// Points 0.05 m apart on a wall, but for number 5, which hangs before it, and number 8, which is not
// finite.
Cloud::Ptr wallWithDust() {
  const Cloud::Ptr cloud(new Cloud);
  for (int i = 0; i < 12; ++i) {
    pcl::PointXYZI p;
    p.x = 0.05F * static_cast<float>(i);
    p.y = i == 5 ? 1.0F : 2.0F;
    p.z = i == 8 ? std::numeric_limits<float>::quiet_NaN() : 0.0F;
    p.intensity = static_cast<float>(i);
    cloud->push_back(p);
  }
  cloud->is_dense = false;
  cloud->header.frame_id = "laser";
  cloud->header.stamp = 77;
  return cloud;
}

TEST(IsolatedReturnFilter, DropsTheLonePointAndKeepsHeaderAndFields) {
  Filter filter;
  filter.setInputCloud(wallWithDust());
  Cloud out;
  filter.filter(out);
  ASSERT_EQ(out.size(), 10U);
  for (const pcl::PointXYZI& p : out.points) EXPECT_TRUE(p.intensity != 5.0F && p.intensity != 8.0F);
  EXPECT_TRUE(out.is_dense);
  EXPECT_EQ(out.header.frame_id, "laser");
  EXPECT_EQ(out.header.stamp, 77U);
}

TEST(IsolatedReturnFilter, NegativeGivesWhatWouldBeDropped) {
  Filter filter;
  filter.setInputCloud(wallWithDust());
  filter.setNegative(true);
  std::vector<int> indices;
  filter.filter(indices);
  EXPECT_EQ(indices, (std::vector<int>{5, 8}));
}

TEST(IsolatedReturnFilter, OnlyTheGivenIndicesAreLookedAtInTheirOrder) {
  Filter filter;
  filter.setInputCloud(wallWithDust());
  filter.setIndices(pcl::IndicesPtr(new std::vector<int>{0, 1, 5, 2, 11}));
  std::vector<int> indices;
  filter.filter(indices);
  // 11 is too far from the 2 before it.
  EXPECT_EQ(indices, (std::vector<int>{0, 1, 2}));
}

TEST(IsolatedReturnFilter, KeepOrganizedReplacesByTheUsersValue) {
  Filter filter(true);
  filter.setInputCloud(wallWithDust());
  filter.setKeepOrganized(true);
  filter.setUserFilterValue(-7.0F);
  Cloud out;
  filter.filter(out);
  ASSERT_EQ(out.size(), 12U);
  EXPECT_EQ(out.points[5].x, -7.0F);
  EXPECT_EQ(out.points[5].intensity, 5.0F);
  EXPECT_EQ(out.points[4].y, 2.0F);
  EXPECT_EQ(*filter.getRemovedIndices(), (std::vector<int>{5, 8}));
}

TEST(IsolatedReturnFilter, SlopeLetsFarPointsKeepEachOther) {
  const Cloud::Ptr cloud(new Cloud);
  for (int i = 0; i < 4; ++i) {
    pcl::PointXYZI p;
    p.x = 20.0F + static_cast<float>(i);
    p.y = p.z = 0.0F;
    cloud->push_back(p);
  }
  Filter filter;
  filter.setInputCloud(cloud);
  filter.setDistance(0.1F);
  std::vector<int> indices;
  filter.setSlope(0.05F);
  filter.filter(indices);
  EXPECT_EQ(indices.size(), 4U);
  filter.setSlope(0.02F);
  filter.filter(indices);
  EXPECT_TRUE(indices.empty());
}

TEST(IsolatedReturnFilter, SmallAndEmptyCloudsAreFine) {
  Filter filter;
  const Cloud::Ptr cloud(new Cloud);
  std::vector<int> indices;
  for (int i = 0; i < 3; ++i) {
    filter.setInputCloud(cloud);
    filter.filter(indices);
    EXPECT_EQ(indices.size(), i < 2 ? 0U : 2U);
    cloud->push_back(pcl::PointXYZI());
  }
}

}  // namespace
}  // namespace tunnel_pilot::perception
