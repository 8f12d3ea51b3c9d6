// Places along a tunnel by what its wall looks like: one section (radius and reflectivity around the axis) every half
// metre of way, windows of sections compared by normalized correlation (specification of the LiDAR odometry, 5.9 b).
// What is constant along the tunnel (its profile, the lane driven on) is taken out first; what is left are niches,
// passages, equipment, roughness and paint.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "components/mapping/cloud.hpp"

namespace adit::mapping {

constexpr std::size_t sectors = 36;      // around the axis of travel, 10 degrees each; 0 at +y (left), then up
constexpr double section_spacing = 0.5;  // m of way

struct Section {
  std::array<float, sectors> radius{};        // m from the path, mean of the sector; 0: nothing there
  std::array<float, sectors> reflectivity{};  // mean of the sector
};

// The sections of the way between two poses (a straight piece), `count` of them, evenly spaced, from the points around
// it. Points and poses in one frame; the poses look along the way. Points beyond `reach` from the axis [m] are left
// out.
std::vector<Section> cut_sections(std::span<const Point> points, const Pose& from, const Pose& to, std::size_t count,
                                  double reach);

// Position of a path beside another one in the same tunnel [m left, m up], from the constant part of their sections.
Eigen::Vector2d offset_between(std::span<const Section> of, std::span<const Section> from, bool reversed);

struct SectionMatch {
  std::size_t end = 0;    // section of the history that corresponds to the last one of the window
  bool reversed = false;  // driven the other way: the history runs backwards
  double score = 0.0;     // correlation, 1: equal
};

// All sections of a drive, in the order of the way.
class SectionHistory {
 public:
  struct Config {
    std::size_t window = 80;       // sections: 40 m
    std::size_t smoothing = 16;    // sections to each side whose mean is the constant part: 8 m
    double least_contrast = 0.15;  // of a window (1: strong): below it there is nothing to recognize
    std::size_t apart = 10;        // sections between two separate peaks: 5 m
  };
  SectionHistory() = default;
  explicit SectionHistory(const Config& config) : config_(config) {}

  void add(const Section& section);
  // The next section does not follow on the last one (the odometry jumped): no window spans the two.
  void begin_run() { run_begin_ = raw_.size(); }
  std::size_t size() const { return raw_.size(); }
  // Sections before this one are final: a window may end there.
  std::size_t ready() const { return features_.size(); }
  const Section& section(std::size_t i) const { return raw_[i]; }
  std::span<const Section> sections() const { return raw_; }
  const Config& config() const { return config_; }

  // Correlation of the window that ends at `end` with that which ends at (or, reversed, begins at) `other`. Nothing
  // without contrast, or if either is not in the history.
  std::optional<double> correlate(std::size_t end, std::size_t other, bool reversed) const;
  // The separate places of sections [0, before) that look like the window that ends at `end`, best first, at most
  // `most`.
  std::vector<SectionMatch> search(std::size_t end, std::size_t before, std::size_t most) const;

 private:
  using Feature = std::array<float, 2 * sectors>;  // high-passed, scaled to about 1; 0: unknown
  Feature feature(std::size_t i) const;
  double energy(std::size_t first) const;  // of the window that begins there
  bool holds_window(std::size_t end) const;
  bool has_contrast(double energy) const;
  // The window that ends at `end`, turned around if it was driven the other way than the history.
  std::vector<Feature> window(std::size_t end, bool reversed) const;
  std::optional<double> correlate(const std::vector<Feature>& window, double energy, std::size_t other,
                                  bool reversed) const;

  Config config_;
  std::vector<Section> raw_;
  std::size_t run_begin_ = 0;
  std::vector<std::uint32_t> run_of_;  // first section of the run of each section
  std::vector<Feature> features_;
  std::vector<double> energy_{0.0};  // sums of squares up to a section
};

}  // namespace adit::mapping
