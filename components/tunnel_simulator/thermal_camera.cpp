#include "components/tunnel_simulator/thermal_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "components/tunnel_simulator/noise.hpp"
#include "components/tunnel_simulator/normal_table.hpp"
#include "components/tunnel_simulator/parallel.hpp"
#include "components/tunnel_simulator/pose_samples.hpp"
#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr int kTile = 4;
constexpr double kKnot = 2e-3;  // of the pose's interpolation [s]

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
  for (float t = kBegin; t <= kEnd; t += kStep) {
    table_.push_back(static_cast<float>(band_radiance(static_cast<double>(t) + 273.15)));
  }
}

float BandRadiance::slope_at(float celsius) const {
  return (at(celsius + 0.5F) - at(celsius - 0.5F));
}

ThermalCamera::ThermalCamera(ThermalConfig config, std::uint64_t seed)
    : config_(std::move(config)), seed_(seed), lag_(config_.camera, config_.time_constant, config_.row_time) {
  const CameraModel& m = config_.camera;
  const auto size = static_cast<std::size_t>(m.width) * static_cast<std::size_t>(m.height);
  const int tiles_across = (m.width + kTile - 1) / kTile;
  tiles_.resize(static_cast<std::size_t>(tiles_across * ((m.height + kTile - 1) / kTile)));
  for (std::vector<float>* plane : {&plane_x_, &plane_y_, &ray_z_, &radiance_, &range_}) plane->resize(size);
  key_.resize(size);
  for (int y = 0; y < m.height; ++y) {
    for (int x = 0; x < m.width; ++x) {
      const Eigen::Vector3f ray = m.ray({x, y}).cast<float>();
      const std::size_t i = row_begin(y) + static_cast<std::size_t>(x);
      plane_x_[i] = ray.x() / ray.z();
      plane_y_[i] = ray.y() / ray.z();
      ray_z_[i] = ray.z();
      TileRays& tile = tiles_[static_cast<std::size_t>(y / kTile * tiles_across + x / kTile)];
      const auto lane = static_cast<std::size_t>(y % kTile * kTile + x % kTile);
      tile.x[lane] = ray.x();
      tile.y[lane] = ray.y();
      tile.z[lane] = ray.z();
    }
  }
  poses_.resize(static_cast<std::size_t>(m.height));
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

namespace {

// Logarithms of the footprints of pixels on the lining: a pixel is stretched along the direction in which it sees the
// wall at a slant. `size`: of a pixel seen square at range 1 [m]. Loops over plain arrays: they vectorize.
void footprints(const RayPacket& rays, const HitPacket& hits, float size, RayPacket::F& log_s, RayPacket::F& log_u) {
  for (std::size_t i = 0; i < kPacket; ++i) {
    const float norm2 = hits.nx[i] * hits.nx[i] + hits.ny[i] * hits.ny[i] + hits.nz[i] * hits.nz[i];
    const float scale = 1.0F / std::sqrt(std::max(norm2, 1e-30F));
    const float slant = scale * (rays.dx[i] * hits.nx[i] + rays.dy[i] * hits.ny[i] + rays.dz[i] * hits.nz[i]);
    const float slant2 = std::min(1.0F, slant * slant);
    const float axis = scale * (hits.ax[i] * hits.nx[i] + hits.ay[i] * hits.ny[i]);
    const float along = rays.dx[i] * hits.ax[i] + rays.dy[i] * hits.ay[i] - slant * axis;
    const float share = std::min(1.0F, along * along / std::max(1e-6F, 1.0F - slant2));
    const float stretch = 1.0F / std::max(0.0004F, slant2) - 1.0F;
    const float side = rays.far[i] * size;
    const float area = side * side;
    log_s[i] = 0.5F * log2_of(area * (1.0F + stretch * share));
    log_u[i] = 0.5F * log2_of(area * (1.0F + stretch * (1.0F - share)));
  }
}

}  // namespace

void ThermalCamera::shade(const RayCaster& caster, const Atmosphere& atmosphere, const RayPacket& packet,
                          const Eigen::Vector3d& from, Pixels& out) const {
  HitPacket hits;
  caster.surfaces(packet, hits);
  RayPacket::F log_s, log_u;
  footprints(packet, hits, 1.0F / static_cast<float>(config_.camera.fx), log_s, log_u);
  for (std::size_t i = 0; i < kPacket; ++i) {
    if (!packet.hit(i)) {
      out.radiance[i] = packet.dz[i] > 0.03F ? sky_radiance_ : wall_radiance_;
      out.range[i] = 0.0F;
      out.key[i] = 0;
      continue;
    }
    float kelvin = hits.temperature[i];
    if (hits.texture[i] != nullptr) kelvin += hits.texture[i]->temperature(hits.s[i], hits.u[i], log_s[i], log_u[i]);
    out.radiance[i] =
        hits.emissivity[i] * band_.at(wall_celsius_ + kelvin) + (1.0F - hits.emissivity[i]) * air_radiance_;
    out.range[i] = packet.far[i];
    out.key[i] = hits.key[i];
  }
  if (atmosphere.empty()) return;
  for (std::size_t i = 0; i < kPacket; ++i) {
    const double range = out.range[i] > 0.0F ? static_cast<double>(out.range[i]) : 500.0;
    const Eigen::Vector3d direction(packet.dx[i], packet.dy[i], packet.dz[i]);
    const auto clear = static_cast<float>(std::exp(-atmosphere.depth(from, direction, range).thermal));
    out.radiance[i] = clear * out.radiance[i] + (1.0F - clear) * air_radiance_;
  }
}

void ThermalCamera::render_tile_row(const RayCaster& caster, const Atmosphere& atmosphere, int tile_row) {
  const CameraModel& m = config_.camera;
  RayPacket packet;
  packet.time.fill(0.5F);
  std::array<RayPacket::F, 9> turn;  // world <- camera of each lane's row, by columns
  for (std::size_t lane = 0; lane < kPacket; ++lane) {
    const int y = std::min(m.height - 1, tile_row * kTile + static_cast<int>(lane) / kTile);
    const Pose& pose = poses_[static_cast<std::size_t>(y)];
    for (std::size_t k = 0; k < 9; ++k) {
      turn[k][lane] =
          static_cast<float>(pose.linear()(static_cast<Eigen::Index>(k % 3), static_cast<Eigen::Index>(k / 3)));
    }
    const Eigen::Vector3f start = (pose.translation() - caster.origin()).cast<float>();
    packet.ox[lane] = start.x();
    packet.oy[lane] = start.y();
    packet.oz[lane] = start.z();
  }
  const Eigen::Vector3d from = poses_[static_cast<std::size_t>(tile_row * kTile)].translation();
  Pixels pixels;
  const int tiles_across = (m.width + kTile - 1) / kTile;
  for (int t = 0; t < tiles_across; ++t) {
    const TileRays& rays = tiles_[static_cast<std::size_t>(tile_row * tiles_across + t)];
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      const float x = rays.x[lane], y = rays.y[lane], z = rays.z[lane];
      packet.dx[lane] = turn[0][lane] * x + turn[3][lane] * y + turn[6][lane] * z;
      packet.dy[lane] = turn[1][lane] * x + turn[4][lane] * y + turn[7][lane] * z;
      packet.dz[lane] = turn[2][lane] * x + turn[5][lane] * y + turn[8][lane] * z;
      packet.far[lane] = 1e4F;
    }
    const int columns = std::min(kTile, m.width - t * kTile);
    const int rows = std::min(kTile, m.height - tile_row * kTile);
    if (columns < kTile || rows < kTile) {
      for (int lane = 0; lane < static_cast<int>(kPacket); ++lane) {
        if (lane % kTile >= columns || lane / kTile >= rows) packet.far[static_cast<std::size_t>(lane)] = -1.0F;
      }
    }
    caster.cast(packet);
    caster.prefetch(packet);
    shade(caster, atmosphere, packet, from, pixels);
    for (int r = 0; r < rows; ++r) {
      const std::size_t first = row_begin(tile_row * kTile + r) + static_cast<std::size_t>(t * kTile);
      std::copy_n(pixels.radiance.data() + r * kTile, columns, radiance_.data() + first);
      std::copy_n(pixels.range.data() + r * kTile, columns, range_.data() + first);
      std::copy_n(pixels.key.data() + r * kTile, columns, key_.data() + first);
    }
  }
}

// Pixels where the thing seen changes are averaged over four sub-rays, into radiance_image_.
void ThermalCamera::resample_edges(const RayCaster& caster, const Atmosphere& atmosphere, int row) {
  const CameraModel& m = config_.camera;
  const std::uint32_t* key = key_.data() + row_begin(row);
  float* out = radiance_image_.data() + row_begin(row);
  const Pose& pose = poses_[static_cast<std::size_t>(row)];
  const Eigen::Vector3f from = (pose.translation() - caster.origin()).cast<float>();
  const Eigen::Matrix3f turn = pose.linear().cast<float>();
  const float offset = 0.25F / static_cast<float>(m.fx);
  std::array<int, 4> pending{};
  std::size_t waiting = 0;
  Pixels pixels;
  RayPacket packet;
  packet.time.fill(0.5F);
  packet.ox.fill(from.x());
  packet.oy.fill(from.y());
  packet.oz.fill(from.z());
  const auto flush = [&] {
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      packet.far[lane] = lane / 4 < waiting ? 1e4F : -1.0F;
      if (lane / 4 >= waiting) continue;
      const std::size_t i = row_begin(row) + static_cast<std::size_t>(pending[lane / 4]);
      const Eigen::Vector3f ray(plane_x_[i] + (lane % 2 == 0 ? -offset : offset),
                                plane_y_[i] + (lane % 4 < 2 ? -offset : offset), 1.0F);
      const Eigen::Vector3f direction = turn * ray.normalized();
      packet.dx[lane] = direction.x();
      packet.dy[lane] = direction.y();
      packet.dz[lane] = direction.z();
    }
    caster.cast(packet);
    caster.prefetch(packet);
    shade(caster, atmosphere, packet, pose.translation(), pixels);
    for (std::size_t k = 0; k < waiting; ++k) {
      const float* r = pixels.radiance.data() + 4 * k;
      out[pending[k]] = 0.25F * (r[0] + r[1] + r[2] + r[3]);
    }
    waiting = 0;
  };
  std::copy_n(radiance_.data() + row_begin(row), m.width, out);
  if (!config_.edges) return;
  const std::uint32_t* above = row > 0 ? key - m.width : key;
  const std::uint32_t* below = row + 1 < m.height ? key + m.width : key;
  for (int x = 0; x < m.width; ++x) {
    const std::uint32_t here = key[x];
    const bool edge = key[std::max(0, x - 1)] != here || key[std::min(m.width - 1, x + 1)] != here ||
                      above[x] != here || below[x] != here;
    if (!edge) continue;
    pending[waiting++] = x;
    if (waiting == pending.size()) flush();
  }
  if (waiting > 0) flush();
}

// Separable Gaussian from work_ back into work_, by way of radiance_image_.
void ThermalCamera::optics(int threads) {
  const CameraModel& m = config_.camera;
  const int half = static_cast<int>(kernel_.size()) / 2;
  parallel_for(threads, static_cast<std::size_t>(m.height), [&](std::size_t r) {
    const float* in = work_.data() + row_begin(static_cast<int>(r));
    float* out = radiance_image_.data() + row_begin(static_cast<int>(r));
    std::fill_n(out, m.width, 0.0F);
    for (int k = -half; k <= half; ++k) {
      const float weight = kernel_[static_cast<std::size_t>(k + half)];
      const int inner_begin = std::clamp(-k, 0, m.width);
      const int inner_end = std::clamp(m.width - k, inner_begin, m.width);
      for (int x = 0; x < inner_begin; ++x) out[x] += weight * in[0];
      for (int x = inner_begin; x < inner_end; ++x) out[x] += weight * in[x + k];
      for (int x = inner_end; x < m.width; ++x) out[x] += weight * in[m.width - 1];
    }
  });
  parallel_for(threads, static_cast<std::size_t>(m.height), [&](std::size_t r) {
    float* out = work_.data() + row_begin(static_cast<int>(r));
    std::fill_n(out, m.width, 0.0F);
    for (int k = -half; k <= half; ++k) {
      const float weight = kernel_[static_cast<std::size_t>(k + half)];
      const float* in = radiance_image_.data() + row_begin(std::clamp(static_cast<int>(r) + k, 0, m.height - 1));
      for (int x = 0; x < m.width; ++x) out[x] += weight * in[x];
    }
  });
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
  const auto middle = static_cast<float>(config_.counts_at_wall);
  const std::size_t base = row_begin(row);
  const auto count = [](float value) { return static_cast<std::uint16_t>(std::clamp(value, 0.0F, 16383.0F) + 0.5F); };
  if (!config_.noise) {
    for (std::size_t i = base; i < base + static_cast<std::size_t>(m.width); ++i) {
      image.counts[i] = count(gain * (work_[i] - wall_radiance_) + middle);
    }
    return;
  }
  const NormalTable& normal = NormalTable::instance();
  for (int x = 0; x < m.width; x += 4) {
    const std::array<float, 4> white = normal.four(random.bits(base + static_cast<std::size_t>(x)));
    for (int k = 0; k < std::min(4, m.width - x); ++k) {
      const auto column = static_cast<std::size_t>(x + k);
      const std::size_t i = base + column;
      const float value = response * gain * (work_[i] - wall_radiance_) + netd * white[static_cast<std::size_t>(k)] +
                          columns * columns_[column] + pattern * pattern_[i] + drift;
      image.counts[i] = count(value + middle);
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
  image.counts.resize(key_.size());
  update_pattern(time, threads);
  const RandomStream random(seed_, 206, frame);
  for (std::size_t x = 0; x < columns_.size(); ++x) columns_[x] = random.normal_pair(x).first;

  sample_poses(pose, time, config_.row_time, kKnot, poses_);
  const Atmosphere around = atmosphere.empty() ? atmosphere : atmosphere.near(poses_[0].translation(), 150.0);
  parallel_for(threads, static_cast<std::size_t>((m.height + kTile - 1) / kTile),
               [&](std::size_t y) { render_tile_row(caster, around, static_cast<int>(y)); });
  parallel_for(threads, static_cast<std::size_t>(m.height),
               [&](std::size_t y) { resample_edges(caster, around, static_cast<int>(y)); });
  if (config_.time_constant > 0.0) {
    lag_.begin(pose, time);
    parallel_for(threads, static_cast<std::size_t>(m.height), [&](std::size_t y) {
      lag_.apply(static_cast<int>(y), {plane_x_, plane_y_, ray_z_}, range_, radiance_image_, work_);
    });
  } else {
    work_ = radiance_image_;
  }
  if (!kernel_.empty()) optics(threads);
  parallel_for(threads, static_cast<std::size_t>(m.height),
               [&](std::size_t y) { digitize(static_cast<int>(y), time, frame, image); });
}

}  // namespace adit::tunnel_simulator
