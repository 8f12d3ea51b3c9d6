#include "components/thermal_odometry/corners.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <opencv2/features2d.hpp>

namespace adit::thermal_odometry {
namespace {

// Grey between the 0.5 % and the 99.5 % quantile.
cv::Mat grey_of(const Image& image) {
  std::vector<float> samples;
  for (std::size_t i = 0; i < image.pixels.size(); i += 17) samples.push_back(image.pixels[i]);
  const auto quantile = [&samples](double share) {
    const auto at = samples.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(samples.size() - 1));
    std::nth_element(samples.begin(), at, samples.end());
    return *at;
  };
  const float low = quantile(0.005);
  const float scale = 255.0F / std::max(quantile(0.995) - low, 1e-3F);
  cv::Mat grey(image.height, image.width, CV_8UC1);
  for (int y = 0; y < image.height; ++y) {
    const float* row = image.row(y);
    auto* out = grey.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.width; ++x) {
      out[x] = static_cast<std::uint8_t>(std::clamp((row[x] - low) * scale, 0.0F, 255.0F));
    }
  }
  return grey;
}

// The strongest of each cell.
void spread(std::vector<cv::KeyPoint>& found, int width, const CornerConfig& config) {
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.response > b.response; });
  const int columns = width / config.cell + 1;
  std::vector<int> taken;
  std::erase_if(found, [&](const cv::KeyPoint& point) {
    const auto cell = static_cast<std::size_t>(static_cast<int>(point.pt.y) / config.cell * columns +
                                               static_cast<int>(point.pt.x) / config.cell);
    if (cell >= taken.size()) taken.resize(cell + 1, 0);
    return ++taken[cell] > config.corners_a_cell;
  });
}

}  // namespace

void detect_corners(const Image& image, const CornerConfig& config, std::vector<Corner>& corners,
                    std::vector<Descriptor>& descriptors) {
  corners.clear();
  descriptors.clear();
  constexpr int smallest = 96;  // px: below it ORB's border leaves nothing
  if (image.width < smallest || image.height < smallest) return;
  for (const float value : image.pixels) {
    if (!std::isfinite(value)) return;
  }
  const cv::Mat grey = grey_of(image);
  constexpr int many = 4000;  // before they are spread
  const auto orb =
      cv::ORB::create(many, 1.2F, config.levels, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31, config.fast_threshold);
  std::vector<cv::KeyPoint> found;
  orb->detect(grey, found);
  spread(found, image.width, config);
  cv::Mat rows;
  orb->compute(grey, found, rows);
  for (int i = 0; i < rows.rows; ++i) {
    const cv::Point2f at = found[static_cast<std::size_t>(i)].pt;
    corners.push_back({at.x, at.y, 0.0F});
    std::memcpy(descriptors.emplace_back().data(), rows.ptr(i), sizeof(Descriptor));
  }
}

}  // namespace adit::thermal_odometry
