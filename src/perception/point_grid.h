#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::perception {

/// Neighbouring returns, represented by the first.
struct PointGroup {
  float x = 0.0F;  ///< [m]
  float y = 0.0F;  ///< [m]
  int first = 0;   ///< members are first .. last - 1 of the index list
  int last = 0;
};

/// Frame of a slice across the tunnel: place and direction along the tunnel.
struct SliceFrame {
  float x, y, cosine, sine;
};

/// Point groups hashed into a grid of square cells (lists threaded through an array).
class PointGrid {
 public:
  static constexpr std::size_t kMaxGroups = 32767;

  /// Replaces the content, at most kMaxGroups. Groups outside the grid (far behind or far away) are left
  /// out.
  void fill(const std::vector<PointGroup>& groups);

  /// Calls visit(group index, along, lateral) for each group whose place in `frame` lies in
  /// [-half_length, half_length) x [low, high].
  template <typename Visit>
  void visitSlice(const std::vector<PointGroup>& groups, const SliceFrame& frame, double half_length,
                  double low, double high, Visit visit) const;

 private:
  static constexpr float kCell = 1.0F;  // [m]
  static constexpr int kSizeX = 64;
  static constexpr int kSizeY = 64;
  static constexpr float kFirstX = -22.0F;  // [m]
  static constexpr float kFirstY = -32.0F;  // [m]

  // Cells count from one, so that truncation puts all that lies before the grid into column or row 0.
  // What lies behind it counts as its end: a place may be farther off than an int can count.
  static int cell(float from_first, int size) {
    return static_cast<int>(
        std::min(std::max(-kCell, from_first) / kCell + 1.0F, static_cast<float>(size)));
  }
  static int column(float x) { return cell(x - kFirstX, kSizeX); }
  static int row(float y) { return cell(y - kFirstY, kSizeY); }

  std::array<std::int16_t, kSizeX * kSizeY> heads_{};
  std::vector<std::int16_t> next_;
};

inline void PointGrid::fill(const std::vector<PointGroup>& groups) {
  heads_.fill(-1);
  next_.resize(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const int cx = column(groups[g].x);
    const int cy = row(groups[g].y);
    if (cx < 1 || cy < 1 || cx >= kSizeX || cy >= kSizeY) continue;
    std::int16_t& head = heads_[static_cast<std::size_t>(cy * kSizeX + cx)];
    next_[g] = head;
    head = static_cast<std::int16_t>(g);
  }
}

template <typename Visit>
void PointGrid::visitSlice(const std::vector<PointGroup>& groups, const SliceFrame& frame,
                           double half_length, double low, double high, Visit visit) const {
  const float c = frame.cosine;
  const float s = frame.sine;
  const float x0 = frame.x;
  const float y0 = frame.y;
  const auto half = static_cast<float>(half_length);
  const auto near = static_cast<float>(low);
  const auto far = static_cast<float>(high);
  const float middle = 0.5F * (near + far);
  const float center_x = x0 - middle * s;
  const float center_y = y0 + middle * c;
  const float reach_x = std::abs(c) * half + std::abs(s) * 0.5F * (far - near);
  const float reach_y = std::abs(s) * half + std::abs(c) * 0.5F * (far - near);
  const int first_column = std::max(column(center_x - reach_x), 0);
  const int last_column = std::min(column(center_x + reach_x), kSizeX - 1);
  const int first_row = std::max(row(center_y - reach_y), 0);
  const int last_row = std::min(row(center_y + reach_y), kSizeY - 1);
  for (int cy = first_row; cy <= last_row; ++cy) {
    for (int cx = first_column; cx <= last_column; ++cx) {
      for (int g = heads_[static_cast<std::size_t>(cy * kSizeX + cx)]; g >= 0;
           g = next_[static_cast<std::size_t>(g)]) {
        const PointGroup& p = groups[static_cast<std::size_t>(g)];
        const float along = c * (p.x - x0) + s * (p.y - y0);
        const float lateral = c * (p.y - y0) - s * (p.x - x0);
        if (along < -half || along >= half || lateral < near || lateral > far) continue;
        visit(g, along, lateral);
      }
    }
  }
}

}  // namespace tunnel_pilot::perception
