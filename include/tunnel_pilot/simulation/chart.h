#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::simulation {

/// Colours of the plots (OpenCV's order: blue, green, red).
namespace colour {
const cv::Scalar kInk(60, 60, 60);
const cv::Scalar kGrid(230, 230, 230);
const cv::Scalar kBlue(170, 95, 20);
const cv::Scalar kOrange(25, 125, 235);
const cv::Scalar kGreen(75, 140, 40);
const cv::Scalar kRed(50, 50, 200);
const cv::Scalar kPaleBlue(245, 225, 205);
const cv::Scalar kPaleOrange(205, 228, 250);
const cv::Scalar kPaleYellow(150, 225, 250);
const cv::Scalar kGrey(150, 150, 150);
}  // namespace colour

/// One diagram: axes with round ticks and units, lines, filled areas, a legend. Collects first, then
/// draws anti-aliased into a white image. Non-finite points break a line.
class Chart {
 public:
  Chart(std::string title, std::string x_label, std::string y_label);

  /// Adds a line; only lines with a name stand in the legend. `thickness` [pixels].
  void line(std::vector<geometry::Point> points, const cv::Scalar& colour, const std::string& name = "",
            double thickness = 2.0);
  /// Adds a filled polygon, drawn beneath all lines.
  void area(std::vector<geometry::Point> outline, const cv::Scalar& colour,
            const std::string& name = "");
  /// One unit along x is as long as one along y (a map).
  void equalAxes() { equal_axes_ = true; }
  /// Makes sure that the y axis shows at least [low, high].
  void includeY(double low, double high);

  /// Draws into an image of this size [pixels].
  cv::Mat draw(int width, int height) const;

 private:
  struct Line {
    std::vector<geometry::Point> points;
    cv::Scalar colour;
    std::string name;
    double thickness;
  };
  struct Frame;

  Frame frameFor(int width, int height) const;
  void drawAxes(cv::Mat& image, const Frame& frame) const;
  void drawAreas(cv::Mat& image, const Frame& frame) const;
  void drawLines(cv::Mat& image, const Frame& frame) const;
  void drawLegend(cv::Mat& image, const Frame& frame) const;

  std::string title_;
  std::string x_label_;
  std::string y_label_;
  bool equal_axes_ = false;
  std::vector<double> included_y_;
  std::vector<Line> lines_;
  std::vector<Line> areas_;
};

/// Images below each other as the bytes of one PNG. Throws std::runtime_error when they cannot be
/// encoded.
std::string toPng(const std::vector<cv::Mat>& rows);

}  // namespace tunnel_pilot::simulation
