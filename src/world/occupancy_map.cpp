#include "occupancy_map.h"

#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace tunnel_pilot::world {
namespace {

constexpr std::uintmax_t kMaxImageBytes = 256u << 20;
constexpr int kMaxSide = 16384;              // [cells]
constexpr std::int64_t kMaxEdges = 500'000;  // between occupied and free cells, along the rows

struct MapHeader {
  std::string image;
  double resolution = 0.0;  // [m] a cell
  geometry::Pose origin;    // of the image's lower left corner
  bool negate = false;
  double occupied_thresh = 0.0;  // [1]
};

MapHeader readHeader(config::Node& node) {
  MapHeader header;
  header.image = node.text("image");
  header.resolution = node.number("resolution", "m", 0.001, 10.0);
  const std::vector<double> origin = node.numbers("origin", "m, m, rad", -1e6, 1e6, 3, 3);
  header.origin = {origin[0], origin[1], origin[2]};
  header.negate = node.integer("negate", "1", 0, 1) == 1;
  header.occupied_thresh = node.number("occupied_thresh", "1", 0.0, 1.0);
  const double free_thresh = node.number("free_thresh", "1", 0.0, 1.0);
  if (free_thresh >= header.occupied_thresh) {
    node.refuse("free_thresh", "[1] must be less than occupied_thresh");
  }
  if (node.has("mode")) node.choice("mode", {"trinary"});
  node.finish();
  return header;
}

cv::Mat readImage(const config::Node& node, const MapHeader& header) {
  const auto path = std::filesystem::path(node.source()).parent_path() / header.image;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    node.refuse("image", "= '" + path.string() + "' is not a file");
  }
  if (std::filesystem::file_size(path, error) > kMaxImageBytes) {
    node.refuse("image", "= '" + path.string() + "' is larger than 256 MiB");
  }
  cv::Mat image;
  try {
    image = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) node.refuse("image", "= '" + path.string() + "' is no image that OpenCV can read");
  if (image.cols > kMaxSide || image.rows > kMaxSide) {
    node.refuse("image", "must be at most 16384 cells wide and high");
  }
  return image;
}

// As map_server does: the darker a cell (or the lighter, when negated) the likelier it is occupied.
cv::Mat occupiedCells(const cv::Mat& image, const MapHeader& header) {
  cv::Mat occupied(image.size(), CV_8U);
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      const int value = image.at<std::uint8_t>(row, column);
      const double probability = (header.negate ? value : 255 - value) / 255.0;
      occupied.at<std::uint8_t>(row, column) = probability > header.occupied_thresh ? 255 : 0;
    }
  }
  return occupied;
}

// Noise has walls everywhere: their outlines would not fit into memory.
std::int64_t edgesIn(const cv::Mat& occupied) {
  std::int64_t edges = 0;
  for (int row = 0; row < occupied.rows; ++row) {
    const auto* cells = occupied.ptr<std::uint8_t>(row);
    for (int column = 1; column < occupied.cols; ++column) edges += cells[column] != cells[column - 1];
  }
  return edges;
}

// A contour of one cell is a point, so the cell's own outline stands for it.
std::vector<cv::Point2d> outlineOf(const std::vector<cv::Point>& contour) {
  std::vector<cv::Point> corners;
  cv::approxPolyDP(contour, corners, 0.5, true);
  std::vector<cv::Point2d> outline(corners.begin(), corners.end());
  if (outline.size() > 1) return outline;
  const cv::Point2d cell = outline.front();
  return {{cell.x - 0.5, cell.y - 0.5},
          {cell.x + 0.5, cell.y - 0.5},
          {cell.x + 0.5, cell.y + 0.5},
          {cell.x - 0.5, cell.y + 0.5}};
}

}  // namespace

std::vector<WallChain> loadOccupancyMap(const std::string& file) {
  config::Node node = config::loadFile(file);
  const MapHeader header = readHeader(node);
  const cv::Mat image = readImage(node, header);
  const cv::Mat occupied = occupiedCells(image, header);
  if (edgesIn(occupied) > kMaxEdges) {
    node.refuse("image", "= '" + header.image + "' is no map but noise: more than " +
                             std::to_string(kMaxEdges) + " edges between occupied and free cells");
  }
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(occupied, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  std::vector<WallChain> walls;
  for (const std::vector<cv::Point>& contour : contours) {
    WallChain chain;
    for (const cv::Point2d& cell : outlineOf(contour)) {
      chain.push_back(header.origin.transform(
          {(cell.x + 0.5) * header.resolution, (image.rows - 0.5 - cell.y) * header.resolution}));
    }
    chain.push_back(chain.front());
    walls.push_back(std::move(chain));
  }
  if (walls.empty()) node.refuse("image", "= '" + header.image + "' has no occupied cell");
  return walls;
}

}  // namespace tunnel_pilot::world
