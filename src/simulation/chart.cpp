#include "tunnel_pilot/simulation/chart.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

namespace tunnel_pilot::simulation {
namespace {

using geometry::Point;

constexpr int kOversampling = 2;  // drawn larger, then shrunk: OpenCV's fonts look better so
constexpr int kShift = 4;         // sub-pixel bits of OpenCV's drawing functions
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kTickTarget = 90.0;  // pixels between ticks
constexpr double kFontHeight = 0.48;

// Smallest of 1, 2, 5 times a power of ten that is not below `raw`.
double roundStep(double raw) {
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw * (1.0 - 1e-9)) return factor * power;
  }
  return 10.0 * power;
}

std::string tickText(double value, double step) {
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", decimals, std::abs(value) < 0.5e-9 ? 0.0 : value);
  return text;
}

cv::Size textSize(const std::string& text, double scale) {
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, kFont, scale * kOversampling, 1, &baseline);
  return size;
}

void putText(cv::Mat& image, const std::string& text, double x, double y, double scale,
             const cv::Scalar& colour, int weight = kOversampling) {
  cv::putText(image, text, cv::Point(static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y))),
              kFont, scale * kOversampling, colour, weight, cv::LINE_AA);
}

// Text turned by a quarter, reading upwards, centred on (x, y).
void putTextUpwards(cv::Mat& image, const std::string& text, double x, double y) {
  const cv::Size size = textSize(text, kFontHeight);
  cv::Mat canvas(size.height + 16 * kOversampling, size.width + 8, image.type(), cv::Scalar::all(255));
  putText(canvas, text, 4, size.height + 4 * kOversampling, kFontHeight, colour::kInk);
  cv::rotate(canvas, canvas, cv::ROTATE_90_COUNTERCLOCKWISE);
  const cv::Rect wanted(static_cast<int>(x) - canvas.cols / 2, static_cast<int>(y) - canvas.rows / 2,
                        canvas.cols, canvas.rows);
  const cv::Rect room = wanted & cv::Rect(0, 0, image.cols, image.rows);
  canvas(room - wanted.tl()).copyTo(image(room));
}

}  // namespace

// Where the diagram lies in the image, and the way from its units to (oversampled) pixels.
struct Chart::Frame {
  cv::Rect box;
  double x_low, x_high, y_low, y_high;

  double x(double value) const { return box.x + (value - x_low) / (x_high - x_low) * box.width; }
  double y(double value) const {
    return box.y + box.height - (value - y_low) / (y_high - y_low) * box.height;
  }
  cv::Point pixel(const Point& p) const {  // in 1/16 pixels
    const double far = 1e6;                // keeps OpenCV's integers from overflowing
    return {static_cast<int>(std::lround(std::clamp(x(p.x()), -far, far) * (1 << kShift))),
            static_cast<int>(std::lround(std::clamp(y(p.y()), -far, far) * (1 << kShift)))};
  }
};

Chart::Chart(std::string title, std::string x_label, std::string y_label)
    : title_(std::move(title)), x_label_(std::move(x_label)), y_label_(std::move(y_label)) {}

void Chart::line(std::vector<Point> points, const cv::Scalar& colour, const std::string& name,
                 double thickness) {
  lines_.push_back({std::move(points), colour, name, thickness});
}

void Chart::area(std::vector<Point> outline, const cv::Scalar& colour, const std::string& name) {
  areas_.push_back({std::move(outline), colour, name, 0.0});
}

void Chart::includeY(double low, double high) {
  included_y_.push_back(low);
  included_y_.push_back(high);
}

Chart::Frame Chart::frameFor(int width, int height) const {
  const double inf = std::numeric_limits<double>::infinity();
  Frame frame{cv::Rect(80, 44, width - 104, height - 100), inf, -inf, inf, -inf};
  for (const std::vector<Line>* group : {&lines_, &areas_}) {
    for (const Line& one : *group) {
      for (const Point& p : one.points) {
        if (!p.allFinite()) continue;
        frame.x_low = std::min(frame.x_low, p.x());
        frame.x_high = std::max(frame.x_high, p.x());
        frame.y_low = std::min(frame.y_low, p.y());
        frame.y_high = std::max(frame.y_high, p.y());
      }
    }
  }
  for (const double y : included_y_) {
    frame.y_low = std::min(frame.y_low, y);
    frame.y_high = std::max(frame.y_high, y);
  }
  if (!(frame.x_high > frame.x_low)) frame.x_low = 0.0, frame.x_high = 1.0;
  if (!(frame.y_high > frame.y_low)) {
    const double middle = std::isfinite(frame.y_low) ? frame.y_low : 0.0;
    frame.y_low = middle - 1.0, frame.y_high = middle + 1.0;
  }
  const double margin = 0.06 * (frame.y_high - frame.y_low);
  frame.y_low -= margin;
  frame.y_high += margin;
  if (equal_axes_) {
    const double metres = std::max((frame.x_high - frame.x_low) * 1.04 / frame.box.width,
                                   (frame.y_high - frame.y_low) / frame.box.height);
    const Point centre(0.5 * (frame.x_low + frame.x_high), 0.5 * (frame.y_low + frame.y_high));
    frame.x_low = centre.x() - 0.5 * metres * frame.box.width;
    frame.x_high = centre.x() + 0.5 * metres * frame.box.width;
    frame.y_low = centre.y() - 0.5 * metres * frame.box.height;
    frame.y_high = centre.y() + 0.5 * metres * frame.box.height;
  }
  frame.box = cv::Rect(frame.box.tl() * kOversampling, frame.box.size() * kOversampling);
  return frame;
}

void Chart::drawAxes(cv::Mat& image, const Frame& frame) const {
  const cv::Rect& box = frame.box;
  const double x_step =
      roundStep((frame.x_high - frame.x_low) * kTickTarget * kOversampling / box.width);
  const double y_step =
      roundStep((frame.y_high - frame.y_low) * 0.4 * kTickTarget * kOversampling / box.height);
  for (double x = std::ceil(frame.x_low / x_step) * x_step; x <= frame.x_high; x += x_step) {
    const int column = static_cast<int>(std::lround(frame.x(x)));
    cv::line(image, {column, box.y}, {column, box.br().y}, colour::kGrid, kOversampling);
    const std::string text = tickText(x, x_step);
    putText(image, text, column - 0.5 * textSize(text, kFontHeight).width,
            box.br().y + 18 * kOversampling, kFontHeight, colour::kInk);
  }
  for (double y = std::ceil(frame.y_low / y_step) * y_step; y <= frame.y_high; y += y_step) {
    const int row = static_cast<int>(std::lround(frame.y(y)));
    cv::line(image, {box.x, row}, {box.br().x, row}, colour::kGrid, kOversampling);
    const std::string text = tickText(y, y_step);
    const cv::Size size = textSize(text, kFontHeight);
    putText(image, text, box.x - 8 * kOversampling - size.width, row + 0.5 * size.height, kFontHeight,
            colour::kInk);
  }
  cv::rectangle(image, box, colour::kGrey, kOversampling);
  putText(image, title_, box.x, box.y - 14 * kOversampling, 0.62, colour::kInk, kOversampling + 1);
  const double label_left = box.x + 0.5 * (box.width - textSize(x_label_, kFontHeight).width);
  putText(image, x_label_, label_left, box.br().y + 42 * kOversampling, kFontHeight, colour::kInk);
  putTextUpwards(image, y_label_, 16 * kOversampling, box.y + 0.5 * box.height);
}

void Chart::drawAreas(cv::Mat& image, const Frame& frame) const {
  cv::Mat inside = image(frame.box);
  const cv::Point shift = frame.box.tl() * (1 << kShift);
  for (const Line& one : areas_) {
    std::vector<cv::Point> pixels;
    for (const Point& p : one.points) pixels.push_back(frame.pixel(p) - shift);
    cv::fillPoly(inside, std::vector<std::vector<cv::Point>>{pixels}, one.colour, cv::LINE_AA, kShift);
  }
}

void Chart::drawLines(cv::Mat& image, const Frame& frame) const {
  cv::Mat inside = image(frame.box);
  const cv::Point shift = frame.box.tl() * (1 << kShift);
  for (const Line& one : lines_) {
    std::vector<std::vector<cv::Point>> runs(1);
    for (const Point& p : one.points) {
      if (p.allFinite()) {
        runs.back().push_back(frame.pixel(p) - shift);
      } else if (!runs.back().empty()) {
        runs.emplace_back();
      }
    }
    if (runs.back().empty()) runs.pop_back();
    cv::polylines(inside, runs, false, one.colour,
                  std::max(1, static_cast<int>(std::lround(one.thickness * kOversampling))), cv::LINE_AA,
                  kShift);
  }
}

void Chart::drawLegend(cv::Mat& image, const Frame& frame) const {
  std::vector<std::pair<const Line*, bool>> entries;
  for (const Line& one : lines_) {
    if (!one.name.empty()) entries.emplace_back(&one, false);
  }
  for (const Line& one : areas_) {
    if (!one.name.empty()) entries.emplace_back(&one, true);
  }
  // In one row above the diagram, right-aligned, so that it hides nothing.
  double x = frame.box.br().x;
  const double y = frame.box.y - 14.0 * kOversampling;
  for (auto entry = entries.rbegin(); entry != entries.rend(); ++entry) {
    const auto [one, filled] = *entry;
    x -= textSize(one->name, kFontHeight).width;
    putText(image, one->name, x, y, kFontHeight, colour::kInk);
    x -= 34.0 * kOversampling;
    const cv::Point left(static_cast<int>(x), static_cast<int>(y) - 5 * kOversampling);
    const cv::Point right = left + cv::Point(26 * kOversampling, 0);
    cv::line(image, left, right, one->colour, (filled ? 10 : 3) * kOversampling, cv::LINE_AA);
    x -= 18.0 * kOversampling;
  }
}

cv::Mat Chart::draw(int width, int height) const {
  const Frame frame = frameFor(width, height);
  cv::Mat large(height * kOversampling, width * kOversampling, CV_8UC3, cv::Scalar::all(255));
  drawAreas(large, frame);
  drawAxes(large, frame);
  drawLines(large, frame);
  drawLegend(large, frame);
  cv::Mat image;
  cv::resize(large, image, cv::Size(width, height), 0, 0, cv::INTER_AREA);
  return image;
}

std::string toPng(const std::vector<cv::Mat>& rows) {
  cv::Mat image;
  cv::vconcat(rows, image);
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", image, bytes)) throw std::runtime_error("a picture could not be encoded");
  return std::string(bytes.begin(), bytes.end());
}

}  // namespace tunnel_pilot::simulation
