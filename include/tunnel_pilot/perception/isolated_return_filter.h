#pragma once

#include <cmath>
#include <vector>

#include <pcl/common/io.h>
#include <pcl/filters/filter_indices.h>
#include <pcl/point_types.h>

namespace tunnel_pilot::perception {

/// Removes isolated returns (dust, rain, mixed pixels) from a cloud whose points stand in scan order, as
/// a pcl::Filter: setInputCloud, setIndices, setNegative, setKeepOrganized, setUserFilterValue and
/// extract_removed_indices work as in PCL's own filters, the header is kept.
///
/// Neighbours in space are neighbours in the list, so no search tree is needed: a point stays when at
/// least `min_neighbors` of the `window` points before and the `window` points after it lie nearer than
///     distance + slope * range,
/// range being the point's distance from the cloud's sensor_origin_ [m]. The slope lets far points, which
/// a scanner spaces wider, keep each other. Points that are not finite always go. The cost is O(N window);
/// pcl::RadiusOutlierRemoval and pcl::StatisticalOutlierRemoval do the like for clouds without order.
template <typename PointT>
class IsolatedReturnFilter : public pcl::FilterIndices<PointT> {
 public:
  using PointCloud = pcl::PointCloud<PointT>;

  explicit IsolatedReturnFilter(bool extract_removed_indices = false)
      : pcl::FilterIndices<PointT>(extract_removed_indices) {
    this->filter_name_ = "IsolatedReturnFilter";
  }

  void setWindow(int points) { window_ = points; }              ///< points before and after, at least 1
  void setMinNeighbors(int points) { min_neighbors_ = points; }  ///< at most 2 * window
  void setDistance(float distance) { distance_ = distance; }    ///< [m]
  void setSlope(float slope) { slope_ = slope; }                ///< [1]
  int getWindow() const { return window_; }
  int getMinNeighbors() const { return min_neighbors_; }
  float getDistance() const { return distance_; }
  float getSlope() const { return slope_; }

 protected:
  void applyFilter(PointCloud& output) override {
    std::vector<int> kept;
    const bool extract = this->extract_removed_indices_;
    this->extract_removed_indices_ = extract || this->keep_organized_;
    applyFilter(kept);
    this->extract_removed_indices_ = extract;
    if (!this->keep_organized_) {
      pcl::copyPointCloud(*this->input_, kept, output);
      // A negative filter's output holds the points that are not finite.
      output.is_dense = !this->negative_ || this->input_->is_dense;
      return;
    }
    output = *this->input_;
    for (const int i : *this->removed_indices_) {
      output.points[i].x = output.points[i].y = output.points[i].z = this->user_filter_value_;
    }
    if (!std::isfinite(this->user_filter_value_)) output.is_dense = false;
  }

  void applyFilter(std::vector<int>& kept) override {
    countNeighbors();
    kept.clear();
    this->removed_indices_->clear();
    const std::vector<int>& order = *this->indices_;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const bool stays = (neighbors_[i] >= min_neighbors_) != this->negative_;
      if (stays) {
        kept.push_back(order[i]);
      } else if (this->extract_removed_indices_) {
        this->removed_indices_->push_back(order[i]);
      }
    }
  }

 private:
  static constexpr int kNotFinite = -1;

  // Squared distance within which points keep this one; below zero for a point that is not finite.
  float reachSquared(const PointT& p) const {
    const float range = (p.getVector3fMap() - this->input_->sensor_origin_.template head<3>()).norm();
    if (!std::isfinite(range)) return -1.0F;
    const float reach = distance_ + slope_ * range;
    return reach * reach;
  }

  void countNeighbors() {
    const std::vector<int>& order = *this->indices_;
    const int size = static_cast<int>(order.size());
    neighbors_.assign(order.size(), 0);
    reach_squared_.resize(order.size());
    for (int i = 0; i < size; ++i) {
      reach_squared_[i] = reachSquared(this->input_->points[order[i]]);
      if (reach_squared_[i] < 0.0F) neighbors_[i] = kNotFinite;
    }
    for (int i = 0; i < size; ++i) {
      if (neighbors_[i] == kNotFinite) continue;
      const PointT& p = this->input_->points[order[i]];
      for (int j = i + 1; j < size && j <= i + window_; ++j) {
        if (neighbors_[j] == kNotFinite) continue;
        const PointT& q = this->input_->points[order[j]];
        const float gap_squared = (p.getVector3fMap() - q.getVector3fMap()).squaredNorm();
        if (gap_squared <= reach_squared_[i]) ++neighbors_[i];
        if (gap_squared <= reach_squared_[j]) ++neighbors_[j];
      }
    }
  }

  int window_ = 2;
  int min_neighbors_ = 1;
  float distance_ = 0.1F;
  float slope_ = 0.05F;
  std::vector<int> neighbors_;
  std::vector<float> reach_squared_;
};

}  // namespace tunnel_pilot::perception
