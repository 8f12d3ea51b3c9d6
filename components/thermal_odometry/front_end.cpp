#include "components/thermal_odometry/front_end.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace adit::thermal_odometry {
namespace {

constexpr int gate_step = 16;
constexpr int radius = 2;  // of the bilateral filter

int stride_of(const Frame& frame) {
  return frame.stride > 0 ? frame.stride : frame.width;
}

const std::uint16_t* row_of(const Frame& frame, int y) {
  return frame.data + static_cast<std::ptrdiff_t>(y) * stride_of(frame);
}

template <class T>
T median(std::vector<T>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

FrameGate::FrameGate(const CameraModel& model, const Config& config)
    : width_(model.width), height_(model.height), config_(config), order_(config.clock_run, config.clock_step_s) {
  const auto samples = static_cast<std::size_t>((width_ / gate_step + 1) * (height_ / gate_step + 1));
  last_.reserve(samples);
  current_.reserve(samples);
}

Verdict FrameGate::check(const Frame& frame, float noise) {
  const bool shape_ok = frame.data != nullptr && frame.width == width_ && frame.height == height_ &&
                        (frame.stride == 0 || frame.stride >= frame.width);
  if (!shape_ok) return Verdict::wrong_size;
  clock_set_back_ = false;
  if (!order_.accepts(frame.stamp_ns, last_stamp_ns_)) return Verdict::bad_stamp;
  clock_set_back_ = last_stamp_ns_ && frame.stamp_ns <= *last_stamp_ns_;
  last_stamp_ns_ = frame.stamp_ns;

  current_.clear();
  std::uint32_t low = 65535;
  std::uint32_t high = 0;
  std::uint32_t low_bits = 0;
  std::size_t saturated = 0;
  for (int y = gate_step / 2; y < height_; y += gate_step) {
    const std::uint16_t* row = row_of(frame, y);
    for (int x = gate_step / 2; x < width_; x += gate_step) {
      const std::uint16_t value = row[x];
      current_.push_back(value);
      low = std::min<std::uint32_t>(low, value);
      high = std::max<std::uint32_t>(high, value);
      low_bits |= value & 0xFFU;
      if (value >= frame.saturation) ++saturated;
    }
  }
  double difference = 0.0;
  const bool comparable = last_.size() == current_.size();
  if (comparable) {
    for (std::size_t i = 0; i < current_.size(); ++i) {
      difference += std::abs(static_cast<int>(current_[i]) - static_cast<int>(last_[i]));
    }
    difference /= static_cast<double>(current_.size());
  }
  std::swap(last_, current_);

  if (frame.ffc == FfcState::in_progress) return Verdict::ffc;
  if (2 * saturated > last_.size()) return Verdict::saturated;
  if (low == high) return Verdict::uniform;
  if (high <= 255 || (low_bits == 0 && high > 255)) return Verdict::eight_bit;
  if (comparable && difference < config_.frozen_fraction * noise) return Verdict::frozen;
  return Verdict::good;
}

float estimate_noise(const Frame& frame, std::vector<float>& differences) {
  differences.clear();
  for (int y = 0; y + 1 < frame.height; y += 4) {
    const std::uint16_t* upper = row_of(frame, y);
    const std::uint16_t* lower = row_of(frame, y + 1);
    for (int x = 0; x + 1 < frame.width; x += 4) {
      differences.push_back(0.5F * std::abs(static_cast<float>(upper[x] - upper[x + 1] - lower[x] + lower[x + 1])));
    }
  }
  return differences.empty() ? 1.0F : std::max(1.4826F * median(differences), 0.3F);
}

FrontEnd::FrontEnd(const CameraModel& model, const Config& config) : config_(config), rectifier_(model) {
  for (Image* image : {&counts_, &smoothed_}) {
    image->width = model.width;
    image->height = model.height;
    image->pixels.assign(static_cast<std::size_t>(model.width * model.height), 0.0F);
  }
  columns_.assign(static_cast<std::size_t>(model.width), 0.0F);
  profile_.assign(static_cast<std::size_t>(model.width), 0.0F);
  scratch_.reserve(static_cast<std::size_t>(model.height));
  samples_.reserve(static_cast<std::size_t>((model.width / 4 + 1) * (model.height / 4 + 1)));
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      const float r2 = static_cast<float>(dx * dx + dy * dy);
      space_weights_[static_cast<std::size_t>((dy + radius) * 5 + dx + radius)] =
          std::exp(-0.5F * r2 / (config.bilateral_space * config.bilateral_space));
    }
  }
}

void FrontEnd::calibrate(const Frame& frame) {
  samples_.clear();
  for (int y = 0; y < frame.height; y += 8) {
    for (int x = 0; x < frame.width; x += 8) samples_.push_back(row_of(frame, y)[x]);
  }
  zero_ = median(samples_);
  const float before = noise_;
  noise_ = config_.noise_counts > 0.0F ? config_.noise_counts : estimate_noise(frame, samples_);
  // Stripes learned from pictures of another kind are no stripes of these.
  const float ratio = before / noise_;
  const bool same_kind = calibrated_ && ratio > 0.5F && ratio < 2.0F;
  for (float& column : columns_) column = same_kind ? column * ratio : 0.0F;
  calibrated_ = true;
}

void FrontEnd::process(const Frame& frame, Pyramid& out) {
  const float scale = 1.0F / noise_;
  for (int y = 0; y < counts_.height; ++y) {
    const std::uint16_t* in = row_of(frame, y);
    float* row = counts_.row(y);
    for (int x = 0; x < counts_.width; ++x) row[x] = (static_cast<float>(in[x]) - zero_) * scale;
  }
  if (config_.destripe) {
    update_columns();
    for (int y = 0; y < counts_.height; ++y) {
      float* row = counts_.row(y);
      for (int x = 0; x < counts_.width; ++x) row[x] -= columns_[static_cast<std::size_t>(x)];
    }
  }
  Image& base = out.base();
  const bool straight = rectifier_.identity();
  if (config_.bilateral) {
    Image& filtered = straight ? base : smoothed_;
    smooth(counts_, filtered);
    if (!straight) rectifier_.apply(filtered.pixels.data(), base.pixels.data());
  } else if (straight) {
    std::copy(counts_.pixels.begin(), counts_.pixels.end(), base.pixels.begin());
  } else {
    rectifier_.apply(counts_.pixels.data(), base.pixels.data());
  }
  out.reduce();
}

// The step from column to column is the same in every row for a stripe and changes sign with the texture for the scene:
// its median over the rows, high-passed along x, is the stripe pattern. Limited and slow, so that a vertical edge that
// stays in view costs less than the noise.
void FrontEnd::update_columns() {
  constexpr int step = 8;
  constexpr int half = 8;  // columns of the high-pass
  const int w = counts_.width;
  profile_[0] = 0.0F;
  for (int x = 1; x < w; ++x) {
    scratch_.clear();
    for (int y = (x * 3) % step; y < counts_.height; y += step) {
      const float* row = counts_.row(y);
      scratch_.push_back(row[x] - row[x - 1]);
    }
    profile_[static_cast<std::size_t>(x)] = profile_[static_cast<std::size_t>(x - 1)] + median(scratch_);
  }
  for (int x = 0; x < w; ++x) {
    const int from = std::max(0, x - half);
    const int to = std::min(w - 1, x + half);
    float mean = 0.0F;
    for (int i = from; i <= to; ++i) mean += profile_[static_cast<std::size_t>(i)];
    mean /= static_cast<float>(to - from + 1);
    const float stripe =
        std::clamp(profile_[static_cast<std::size_t>(x)] - mean, -config_.destripe_limit, config_.destripe_limit);
    float& column = columns_[static_cast<std::size_t>(x)];
    column += config_.destripe_rate * (stripe - column);
  }
}

// Bilateral filter (Tomasi and Manduchi 1998) with a biweight range kernel of the Gaussian's curvature at zero: no
// table and no exponential, so that the inner loop runs over x in SIMD registers.
void FrontEnd::smooth(const Image& in, Image& out) const {
  const int w = in.width;
  const int h = in.height;
  const float limit2 = 4.0F * config_.bilateral_range * config_.bilateral_range;  // (1 - d2/limit2)^2 ~ exp(-d2/2s2)
  const float scale = 1.0F / limit2;
  constexpr int block = 64;
  for (int y = 0; y < h; ++y) {
    const float* centre = in.row(y);
    float* target = out.row(y);
    if (y < radius || y >= h - radius) {
      std::copy(centre, centre + w, target);
      continue;
    }
    std::copy(centre, centre + radius, target);
    std::copy(centre + w - radius, centre + w, target + w - radius);
    for (int x0 = radius; x0 < w - radius; x0 += block) {
      const int n = std::min(block, w - radius - x0);
      std::array<float, block> sum;
      std::array<float, block> weight;
      for (int i = 0; i < n; ++i) {
        sum[static_cast<std::size_t>(i)] = 0.0F;
        weight[static_cast<std::size_t>(i)] = 1.0F;
      }
      for (int dy = -radius; dy <= radius; ++dy) {
        const float* row = in.row(y + dy) + x0;
        for (int dx = -radius; dx <= radius; ++dx) {
          if (dx == 0 && dy == 0) continue;
          const float space = space_weights_[static_cast<std::size_t>((dy + radius) * 5 + dx + radius)];
          const float* neighbour = row + dx;
          const float* self = centre + x0;
          for (int i = 0; i < n; ++i) {
            const float difference = neighbour[i] - self[i];
            const float kernel = std::max(0.0F, 1.0F - difference * difference * scale);
            const float w_i = space * kernel * kernel;
            sum[static_cast<std::size_t>(i)] += w_i * difference;
            weight[static_cast<std::size_t>(i)] += w_i;
          }
        }
      }
      for (int i = 0; i < n; ++i) {
        target[x0 + i] = centre[x0 + i] + sum[static_cast<std::size_t>(i)] / weight[static_cast<std::size_t>(i)];
      }
    }
  }
}

}  // namespace adit::thermal_odometry
