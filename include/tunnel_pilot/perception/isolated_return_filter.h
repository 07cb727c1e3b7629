#pragma once

#include <pcl/common/io.h>
#include <pcl/filters/filter_indices.h>
#include <pcl/point_types.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace tunnel_pilot::perception {

/// Removes isolated returns (dust, rain, mixed pixels) from a cloud whose points stand in scan order, as
/// a pcl::Filter: setInputCloud, setIndices, setNegative, setKeepOrganized, setUserFilterValue and
/// extract_removed_indices work as in PCL's own filters, the header is kept.
///
/// Neighbours in space are neighbours in the list, so no search tree is needed: a point stays when at
/// least `min_neighbors` of the `window` points before and the `window` points after it lie nearer than
///     distance + slope * range,
/// range being the point's distance from the cloud's sensor_origin_ [m]. The slope lets far points,
/// which a scanner spaces wider, keep each other. Points that are not finite always go. The cost is O(N
/// window); pcl::RadiusOutlierRemoval and pcl::StatisticalOutlierRemoval do the like for clouds without
/// order.
template <typename PointT>
class IsolatedReturnFilter : public pcl::FilterIndices<PointT> {
 public:
  using PointCloud = pcl::PointCloud<PointT>;

  explicit IsolatedReturnFilter(bool extract_removed_indices = false)
      : pcl::FilterIndices<PointT>(extract_removed_indices) {
    this->filter_name_ = "IsolatedReturnFilter";
  }

  void setWindow(int points) { window_ = points; }               ///< points before and after, at least 1
  void setMinNeighbors(int points) { min_neighbors_ = points; }  ///< at most 2 * window
  void setDistance(float distance) { distance_ = distance; }     ///< [m]
  void setSlope(float slope) { slope_ = slope; }                 ///< [1]
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
    const std::vector<int>& order = *this->indices_;
    kept.resize(order.size());
    std::size_t count = 0;
    for (std::size_t i = 0; i < order.size(); ++i) {
      kept[count] = order[i];
      count += stays(i) ? 1 : 0;
    }
    kept.resize(count);
    this->removed_indices_->clear();
    if (!this->extract_removed_indices_) return;
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (!stays(i)) this->removed_indices_->push_back(order[i]);
    }
  }

 private:
  static constexpr int kNotFinite = -1;

  bool stays(std::size_t i) const { return (neighbors_[i] >= min_neighbors_) != this->negative_; }

  // Coordinates as arrays, so that the compiler may work on several points at once; comparisons with the
  // NaN of a point that is not finite are false, so it is nobody's neighbour.
  void gather() {
    const std::vector<int>& order = *this->indices_;
    const std::size_t size = order.size();
    for (std::vector<float>* v : {&x_, &y_, &z_, &reach_squared_}) v->resize(size);
    const Eigen::Vector4f& origin = this->input_->sensor_origin_;
    for (std::size_t i = 0; i < size; ++i) {
      const PointT& p = this->input_->points[static_cast<std::size_t>(order[i])];
      x_[i] = p.x - origin[0];
      y_[i] = p.y - origin[1];
      z_[i] = p.z - origin[2];
    }
    for (std::size_t i = 0; i < size; ++i) {
      const float reach = distance_ + slope_ * std::sqrt(x_[i] * x_[i] + y_[i] * y_[i] + z_[i] * z_[i]);
      reach_squared_[i] = reach * reach;
    }
  }

  void countNeighbors() {
    gather();
    const std::size_t size = x_.size();
    neighbors_.assign(size, 0);
    for (std::size_t k = 1; k <= static_cast<std::size_t>(window_) && k < size; ++k) {
      near_.resize(size - k);
      const float* x = x_.data();
      const float* y = y_.data();
      const float* z = z_.data();
      const float* reach = reach_squared_.data();
      float* near = near_.data();
      int* neighbors = neighbors_.data();
      for (std::size_t i = 0; i < size - k; ++i) {
        const float dx = x[i + k] - x[i];
        const float dy = y[i + k] - y[i];
        const float dz = z[i + k] - z[i];
        near[i] = dx * dx + dy * dy + dz * dz;
      }
      for (std::size_t i = 0; i < size - k; ++i) neighbors[i] += static_cast<int>(near[i] <= reach[i]);
      for (std::size_t i = 0; i < size - k; ++i) {
        neighbors[i + k] += static_cast<int>(near[i] <= reach[i + k]);
      }
    }
    for (std::size_t i = 0; i < size; ++i) {
      // Infinite coordinates give infinite reaches; those of NaN compare false.
      const bool finite = reach_squared_[i] <= std::numeric_limits<float>::max();
      neighbors_[i] = finite ? neighbors_[i] : kNotFinite;
    }
  }

  int window_ = 2;
  int min_neighbors_ = 1;
  float distance_ = 0.1F;
  float slope_ = 0.05F;
  std::vector<int> neighbors_;
  std::vector<float> x_, y_, z_;      // from the sensor [m]
  std::vector<float> reach_squared_;  // [m^2]
  std::vector<float> near_;           // squared distances to the k-th next [m^2]
};

}  // namespace tunnel_pilot::perception
