#include "components/tunnel_simulator/thermal_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "components/tunnel_simulator/noise.hpp"
#include "components/tunnel_simulator/parallel.hpp"
#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr int kTile = 4;
constexpr float kTableBegin = -60.0F;
constexpr float kTableEnd = 200.0F;
constexpr float kTableStep = 0.25F;

// Midpoint rule over the band; Planck's law with h, c, k of the 2019 SI.
double band_radiance(double kelvin) {
  constexpr double h = 6.62607015e-34, c = 2.99792458e8, k = 1.380649e-23;
  constexpr int steps = 120;
  constexpr double low = 8e-6, high = 14e-6;
  double sum = 0.0;
  for (int i = 0; i < steps; ++i) {
    const double w = low + (high - low) * (i + 0.5) / steps;
    sum += 2.0 * h * c * c / std::pow(w, 5) / std::expm1(h * c / (w * k * kelvin));
  }
  return sum * (high - low) / steps;
}

}  // namespace

BandRadiance::BandRadiance() {
  for (float t = kTableBegin; t <= kTableEnd; t += kTableStep) {
    table_.push_back(static_cast<float>(band_radiance(static_cast<double>(t) + 273.15)));
  }
}

float BandRadiance::at(float celsius) const {
  const float x = std::clamp((celsius - kTableBegin) / kTableStep, 0.0F, static_cast<float>(table_.size()) - 1.001F);
  const auto i = static_cast<std::size_t>(x);
  return table_[i] + (x - static_cast<float>(i)) * (table_[i + 1] - table_[i]);
}

float BandRadiance::slope_at(float celsius) const {
  return (at(celsius + 0.5F) - at(celsius - 0.5F));
}

ThermalCamera::ThermalCamera(ThermalConfig config, std::uint64_t seed) : config_(std::move(config)), seed_(seed) {
  const CameraModel& m = config_.camera;
  const auto size = static_cast<std::size_t>(m.width) * static_cast<std::size_t>(m.height);
  rays_.reserve(size);
  for (int y = 0; y < m.height; ++y) {
    for (int x = 0; x < m.width; ++x) rays_.emplace_back(m.ray({x, y}).cast<float>());
  }
  poses_.resize(static_cast<std::size_t>(m.height));
  pixels_.resize(size);
  radiance_image_.resize(size);
  work_.resize(size);
  pattern_.resize(size);
  columns_.resize(static_cast<std::size_t>(m.width));
  if (config_.blur > 0.0) {
    const int half = static_cast<int>(std::ceil(3.0 * config_.blur));
    float sum = 0.0F;
    for (int i = -half; i <= half; ++i) {
      kernel_.push_back(static_cast<float>(std::exp(-0.5 * i * i / (config_.blur * config_.blur))));
      sum += kernel_.back();
    }
    for (float& k : kernel_) k /= sum;
  }
}

ThermalCamera::Pixel ThermalCamera::shade(const RayCaster& caster, const Atmosphere& atmosphere,
                                          const RayPacket& packet, std::size_t lane, const Eigen::Vector3d& from,
                                          const Eigen::Vector3f& direction) const {
  Pixel out;
  if (!packet.hit(lane)) {
    out.radiance = direction.z() > 0.03F ? sky_radiance_ : wall_radiance_;
  } else {
    out.range = packet.far[lane];
    const SurfaceHit hit = caster.surface(packet, lane);
    out.key = 1000U + hit.key;
    float kelvin = hit.surface->temperature;
    if (hit.texture != nullptr) {
      out.key = 1U + static_cast<std::uint32_t>(hit.surface->material);  // one lining through all chunks
      const float cosine = std::max(0.02F, std::abs(hit.normal.dot(direction)));
      const Eigen::Vector3f along = direction - direction.dot(hit.normal) * hit.normal;
      const float share =
          along.squaredNorm() > 1e-6F ? std::pow(along.dot(hit.axis), 2.0F) / along.squaredNorm() : 0.0F;
      const float stretch = 1.0F / (cosine * cosine) - 1.0F;
      const float footprint = out.range / static_cast<float>(config_.camera.fx);
      kelvin += hit.texture->temperature(hit.s, hit.u, footprint * std::sqrt(1.0F + stretch * share),
                                         footprint * std::sqrt(1.0F + stretch * (1.0F - share)));
    }
    const float emissivity = properties(hit.surface->material).emissivity;
    out.radiance = emissivity * band_.at(wall_celsius_ + kelvin) + (1.0F - emissivity) * air_radiance_;
  }
  if (!atmosphere.empty()) {
    const double range = out.range > 0.0F ? static_cast<double>(out.range) : 500.0;
    const auto clear = static_cast<float>(std::exp(-atmosphere.depth(from, direction.cast<double>(), range).thermal));
    out.radiance = clear * out.radiance + (1.0F - clear) * air_radiance_;
  }
  return out;
}

void ThermalCamera::render_tile_row(const RayCaster& caster, const Atmosphere& atmosphere, int tile_row) {
  const CameraModel& m = config_.camera;
  RayPacket packet;
  std::array<Eigen::Vector3f, kPacket> direction;
  packet.time.fill(0.5F);
  std::array<Eigen::Matrix3f, kTile> turn;
  std::array<Eigen::Vector3f, kTile> from;
  for (int i = 0; i < kTile; ++i) {
    const Pose& pose = poses_[static_cast<std::size_t>(std::min(m.height - 1, tile_row * kTile + i))];
    turn[static_cast<std::size_t>(i)] = pose.linear().cast<float>();
    from[static_cast<std::size_t>(i)] = (pose.translation() - caster.origin()).cast<float>();
  }
  for (int x0 = 0; x0 < m.width; x0 += kTile) {
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      const std::size_t row = lane / kTile;
      const int y = tile_row * kTile + static_cast<int>(row);
      const int x = x0 + static_cast<int>(lane % kTile);
      if (x >= m.width || y >= m.height) {
        packet.far[lane] = -1.0F;
        continue;
      }
      direction[lane] = turn[row] * rays_[static_cast<std::size_t>(y * m.width + x)];
      packet.ox[lane] = from[row].x();
      packet.oy[lane] = from[row].y();
      packet.oz[lane] = from[row].z();
      packet.dx[lane] = direction[lane].x();
      packet.dy[lane] = direction[lane].y();
      packet.dz[lane] = direction[lane].z();
      packet.far[lane] = 1e4F;
    }
    caster.cast(packet);
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      const int y = tile_row * kTile + static_cast<int>(lane / kTile);
      const int x = x0 + static_cast<int>(lane % kTile);
      if (x >= m.width || y >= m.height) continue;
      pixels_[static_cast<std::size_t>(y * m.width + x)] =
          shade(caster, atmosphere, packet, lane, poses_[static_cast<std::size_t>(y)].translation(), direction[lane]);
    }
  }
}

// Pixels where the thing seen changes are averaged over four sub-rays, into radiance_image_.
void ThermalCamera::resample_edges(const RayCaster& caster, const Atmosphere& atmosphere, int row) {
  const CameraModel& m = config_.camera;
  const Pixel* here = pixels_.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(m.width);
  float* out = radiance_image_.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(m.width);
  const Pose& pose = poses_[static_cast<std::size_t>(row)];
  const Eigen::Vector3f from = (pose.translation() - caster.origin()).cast<float>();
  const Eigen::Matrix3f turn = pose.linear().cast<float>();
  const float offset = 0.25F / static_cast<float>(m.fx);
  std::array<int, 4> pending{};
  std::size_t waiting = 0;
  const auto flush = [&] {
    RayPacket packet;
    std::array<Eigen::Vector3f, kPacket> direction;
    packet.time.fill(0.5F);
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      if (lane / 4 >= waiting) {
        packet.far[lane] = -1.0F;
        continue;
      }
      Eigen::Vector3f ray = rays_[static_cast<std::size_t>(row * m.width + pending[lane / 4])];
      ray.x() += (lane % 2 == 0 ? -offset : offset) * ray.z();
      ray.y() += (lane % 4 < 2 ? -offset : offset) * ray.z();
      direction[lane] = turn * ray.normalized();
      packet.ox[lane] = from.x();
      packet.oy[lane] = from.y();
      packet.oz[lane] = from.z();
      packet.dx[lane] = direction[lane].x();
      packet.dy[lane] = direction[lane].y();
      packet.dz[lane] = direction[lane].z();
      packet.far[lane] = 1e4F;
    }
    caster.cast(packet);
    for (std::size_t k = 0; k < waiting; ++k) {
      float sum = 0.0F;
      for (std::size_t lane = 4 * k; lane < 4 * k + 4; ++lane) {
        sum += shade(caster, atmosphere, packet, lane, pose.translation(), direction[lane]).radiance;
      }
      out[pending[k]] = 0.25F * sum;
    }
    waiting = 0;
  };
  for (int x = 0; x < m.width; ++x) {
    out[x] = here[x].radiance;
    const bool edge = config_.edges && ((x > 0 && here[x - 1].key != here[x].key) ||
                                        (x + 1 < m.width && here[x + 1].key != here[x].key) ||
                                        (row > 0 && here[x - m.width].key != here[x].key) ||
                                        (row + 1 < m.height && here[x + m.width].key != here[x].key));
    if (!edge) continue;
    pending[waiting++] = x;
    if (waiting == pending.size()) flush();
  }
  if (waiting > 0) flush();
}

// What a pixel showed a moment ago is now where the image motion carried it: an exponential trail along the flow.
void ThermalCamera::lag(int row, const Vector6d& twist) {
  const CameraModel& m = config_.camera;
  const Eigen::Vector3f v = twist.head<3>().cast<float>();
  const Eigen::Vector3f w = twist.tail<3>().cast<float>();
  const auto fx = static_cast<float>(m.fx);
  const auto fy = static_cast<float>(m.fy);
  const auto tau = static_cast<float>(config_.time_constant);
  for (int x = 0; x < m.width; ++x) {
    const auto i = static_cast<std::size_t>(row * m.width + x);
    const Eigen::Vector3f& ray = rays_[i];
    const float range = pixels_[i].range > 0.0F ? pixels_[i].range : 1e4F;
    const Eigen::Vector3f p = ray * range;
    const Eigen::Vector3f dp = -v - w.cross(p);
    const float trail_x = tau * fx * (dp.x() - ray.x() / ray.z() * dp.z()) / p.z();
    const float trail_y = tau * fy * (dp.y() - ray.y() / ray.z() * dp.z()) / p.z();
    const float length = std::min(60.0F, std::hypot(trail_x, trail_y));
    if (length < 0.25F) {
      work_[i] = radiance_image_[i];
      continue;
    }
    const int taps = std::clamp(static_cast<int>(std::ceil(1.5F * length)), 2, 10);
    float sum = 0.0F;
    for (int k = 0; k < taps; ++k) {
      const float age = -std::log1p(-(static_cast<float>(k) + 0.5F) / static_cast<float>(taps));
      const float px = std::clamp(static_cast<float>(x) + age * trail_x, 0.0F, static_cast<float>(m.width) - 1.001F);
      const float py = std::clamp(static_cast<float>(row) + age * trail_y, 0.0F, static_cast<float>(m.height) - 1.001F);
      const int ix = static_cast<int>(px);
      const int iy = static_cast<int>(py);
      const float tx = px - static_cast<float>(ix);
      const float ty = py - static_cast<float>(iy);
      const float* a = radiance_image_.data() + iy * m.width + ix;
      const float top = a[0] + tx * (a[1] - a[0]);
      const float bottom = a[m.width] + tx * (a[m.width + 1] - a[m.width]);
      sum += top + ty * (bottom - top);
    }
    work_[i] = sum / static_cast<float>(taps);
  }
}

// Separable Gaussian from work_ back into work_, by way of radiance_image_.
void ThermalCamera::optics(int threads) {
  const CameraModel& m = config_.camera;
  const int half = static_cast<int>(kernel_.size()) / 2;
  const auto pass = [&](const std::vector<float>& in, std::vector<float>& out, int step_x, int step_y) {
    parallel_for(threads, static_cast<std::size_t>(m.height), [&](std::size_t r) {
      const int y = static_cast<int>(r);
      for (int x = 0; x < m.width; ++x) {
        float sum = 0.0F;
        for (int k = -half; k <= half; ++k) {
          const int px = std::clamp(x + k * step_x, 0, m.width - 1);
          const int py = std::clamp(y + k * step_y, 0, m.height - 1);
          sum += kernel_[static_cast<std::size_t>(k + half)] * in[static_cast<std::size_t>(py * m.width + px)];
        }
        out[static_cast<std::size_t>(y * m.width + x)] = sum;
      }
    });
  };
  pass(work_, radiance_image_, 1, 0);
  pass(radiance_image_, work_, 0, 1);
}

// The pattern of one epoch between two shutter corrections: white, column and a smooth bowl, unit variance together.
void ThermalCamera::update_pattern(double time, int threads) {
  const double since = time - config_.ffc_first;
  const std::int64_t epoch =
      config_.ffc_first < 0.0 || since < 0.0 ? 0 : 1 + static_cast<std::int64_t>(since / config_.ffc_interval);
  if (epoch == pattern_epoch_) return;
  pattern_epoch_ = epoch;
  const CameraModel& m = config_.camera;
  const RandomStream random(seed_, 201, static_cast<std::uint64_t>(epoch));
  const auto bowl_seed = static_cast<std::uint32_t>(mix(seed_, 202 + static_cast<std::uint64_t>(epoch)));
  parallel_for(threads, static_cast<std::size_t>(m.height), [&](std::size_t y) {
    for (int x = 0; x < m.width; ++x) {
      const std::size_t i = y * static_cast<std::size_t>(m.width) + static_cast<std::size_t>(x);
      const auto [white, unused] = random.normal_pair(i);
      const auto [column, unused2] = random.normal_pair(10000000U + static_cast<std::uint64_t>(x));
      const float bowl = value_noise(static_cast<float>(x) / 200.0F, static_cast<float>(y) / 200.0F, bowl_seed);
      pattern_[i] = 0.70F * white + 0.50F * column + 0.51F * bowl;
    }
  });
}

void ThermalCamera::digitize(int row, double time, std::uint64_t frame, ThermalImage& image) const {
  const CameraModel& m = config_.camera;
  const auto cpk = static_cast<float>(config_.counts_per_kelvin);
  const float gain = cpk / band_.slope_at(wall_celsius_);
  const RandomStream random(seed_, 203, frame);
  const RandomStream epoch(seed_, 204, static_cast<std::uint64_t>(pattern_epoch_));
  const double minutes = image.since_ffc / 60.0;
  const auto pattern = static_cast<float>(config_.pattern + config_.pattern_growth * std::sqrt(minutes)) * cpk;
  const auto drift = static_cast<float>(config_.drift * epoch.normal(1) * minutes) * cpk;
  const float response =
      1.0F + 0.002F * value_noise(static_cast<float>(time / 90.0), 0.5F, static_cast<std::uint32_t>(mix(seed_, 205)));
  const auto columns = static_cast<float>(config_.column_noise) * cpk;
  const auto netd = static_cast<float>(config_.netd) * cpk;
  const std::size_t base = static_cast<std::size_t>(row) * static_cast<std::size_t>(m.width);
  for (int x = 0; x < m.width; x += 2) {
    const auto [n0, n1] = random.normal_pair(base + static_cast<std::size_t>(x));
    for (int k = 0; k < 2 && x + k < m.width; ++k) {
      const std::size_t i = base + static_cast<std::size_t>(x + k);
      float value = gain * (work_[i] - wall_radiance_);
      if (config_.noise) {
        value = response * value + netd * (k == 0 ? n0 : n1) + columns * columns_[static_cast<std::size_t>(x + k)] +
                pattern * pattern_[i] + drift;
      }
      value += static_cast<float>(config_.counts_at_wall);
      image.counts[i] = static_cast<std::uint16_t>(std::lround(std::clamp(value, 0.0F, 16383.0F)));
    }
  }
}

void ThermalCamera::capture(const RayCaster& caster, const Atmosphere& atmosphere, const PoseAt& pose, double time,
                            std::uint64_t frame, int threads, ThermalImage& image) {
  const CameraModel& m = config_.camera;
  image.stamp_ns = std::llround((time + half_readout()) * 1e9);
  const double after = time - config_.ffc_first;
  const double phase = config_.ffc_first < 0.0 || after < 0.0 ? -1.0 : std::fmod(after, config_.ffc_interval);
  image.since_ffc = phase < 0.0 ? time : phase;
  image.focal_plane_celsius = 30.0 + 0.5 * (1.0 - std::exp(-time / 300.0)) * 10.0;
  image.frozen = phase >= 0.0 && phase < config_.ffc_duration && !image.counts.empty();
  image.ffc = image.frozen ? FfcState::in_progress : phase >= 0.0 ? FfcState::complete : FfcState::idle;
  if (image.frozen) return;

  const Temperatures& celsius = caster.temperatures();
  wall_celsius_ = static_cast<float>(celsius.wall);
  wall_radiance_ = band_.at(wall_celsius_);
  air_radiance_ = band_.at(static_cast<float>(celsius.air));
  sky_radiance_ = band_.at(static_cast<float>(celsius.sky));
  image.width = m.width;
  image.height = m.height;
  image.counts.resize(pixels_.size());
  update_pattern(time, threads);
  const RandomStream random(seed_, 206, frame);
  for (std::size_t x = 0; x < columns_.size(); ++x) columns_[x] = random.normal_pair(x).first;

  parallel_for(threads, static_cast<std::size_t>(m.height),
               [&](std::size_t y) { poses_[y] = pose(time + config_.row_time * static_cast<double>(y)); });
  const Atmosphere around = atmosphere.empty() ? atmosphere : atmosphere.near(poses_[0].translation(), 150.0);
  parallel_for(threads, static_cast<std::size_t>((m.height + kTile - 1) / kTile),
               [&](std::size_t y) { render_tile_row(caster, around, static_cast<int>(y)); });
  parallel_for(threads, static_cast<std::size_t>(m.height),
               [&](std::size_t y) { resample_edges(caster, around, static_cast<int>(y)); });
  if (config_.time_constant > 0.0) {
    constexpr double dt = 1e-3;
    const double middle = time + half_readout();
    const Pose before = pose(std::max(0.0, middle - dt));
    const Vector6d twist = se3_log(before.inverse() * pose(middle + dt)) / (middle + dt - std::max(0.0, middle - dt));
    parallel_for(threads, static_cast<std::size_t>(m.height), [&](std::size_t y) { lag(static_cast<int>(y), twist); });
  } else {
    work_ = radiance_image_;
  }
  if (!kernel_.empty()) optics(threads);
  parallel_for(threads, static_cast<std::size_t>(m.height),
               [&](std::size_t y) { digitize(static_cast<int>(y), time, frame, image); });
}

}  // namespace adit::tunnel_simulator
