#include "components/tunnel_simulator/lidar.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>

#include "components/tunnel_simulator/normal_table.hpp"
#include "components/tunnel_simulator/parallel.hpp"
#include "components/tunnel_simulator/pose_samples.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr int kTile = 4;        // rings and columns of a packet
constexpr double kKnot = 2e-3;  // of the pose's interpolation [s]

// Powers are in units of the detection limit: a 10 % target seen square at detection_range has strength 1.
double strength_at(double reflectivity, double range, double detection_range) {
  const double ratio = detection_range / range;
  return reflectivity * 10.0 * ratio * ratio;
}

// 0.9 at strength 1, falling off within a factor of about 3: 1 / (1 + strength^-2.5 / 9).
float detection_probability(float strength) {
  const float power = strength * strength * std::sqrt(strength);
  return power / (power + 1.0F / 9.0F);
}

void set_ray(RayPacket& packet, std::size_t lane, const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
             double far, double time) {
  packet.ox[lane] = static_cast<float>(from.x());
  packet.oy[lane] = static_cast<float>(from.y());
  packet.oz[lane] = static_cast<float>(from.z());
  packet.dx[lane] = static_cast<float>(direction.x());
  packet.dy[lane] = static_cast<float>(direction.y());
  packet.dz[lane] = static_cast<float>(direction.z());
  packet.far[lane] = static_cast<float>(far);
  packet.time[lane] = static_cast<float>(time);
}

}  // namespace

std::size_t LidarScan::returns() const {
  return static_cast<std::size_t>(std::count_if(ranges.begin(), ranges.end(), [](float r) { return r > 0.0F; }));
}

Lidar::Lidar(LidarConfig config, std::uint64_t seed) : config_(std::move(config)), seed_(seed) {
  const BeamTable& b = config_.beams;
  const std::size_t rings = b.elevation.size();
  const auto columns = static_cast<std::size_t>(b.columns);
  returns_.resize(rings * columns);
  edged_.resize(rings * columns);
  beams_.resize(rings * columns);
  poses_.resize(columns + 1);
  cos_.resize(rings * columns);
  sin_.resize(rings * columns);
  for (std::size_t r = 0; r < rings; ++r) {
    for (std::size_t c = 0; c < columns; ++c) {  // clockwise from the back: the front is mid sweep
      const double azimuth =
          std::numbers::pi - 2.0 * std::numbers::pi * static_cast<double>(c) / b.columns + b.azimuth_offset[r];
      const std::size_t i = r * columns + c;
      cos_[i] = std::cos(azimuth);
      sin_[i] = std::sin(azimuth);
      const double level = std::cos(b.elevation[r]);
      beams_[i] = {level * cos_[i], level * sin_[i], std::sin(b.elevation[r])};
    }
  }
}

Lidar::Return Lidar::shade(const RayCaster& caster, const RayPacket& packet, std::size_t lane,
                           const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
  if (!packet.hit(lane)) return {};
  const SurfaceHit hit = caster.surface(packet, lane);
  const MaterialProperties& material = properties(hit.surface->material);
  const float cosine = std::abs(hit.normal.dot(direction.cast<float>()));
  float reflectivity = material.reflectivity * hit.surface->reflectivity;
  if (hit.texture != nullptr) reflectivity *= hit.texture->reflectivity(hit.s, hit.u);
  Return out;
  out.range = caster.exact_range(packet, lane, from, direction);
  out.reflectivity = reflectivity * cosine + material.retro * cosine * cosine;
  out.strength = static_cast<float>(strength_at(out.reflectivity, std::max(out.range, 0.1), config_.detection_range));
  return out;
}

// Echoes nearer than half a metre merge into one of mean range; otherwise the stronger wins.
Lidar::Return Lidar::strongest(std::span<const Echo> echoes) {
  Return best;
  for (std::size_t i = 0; i < echoes.size();) {
    double range = 0.0;
    Return sum;
    std::size_t j = i;
    for (; j < echoes.size() && (j == i || echoes[j].part.range - echoes[j - 1].part.range < 0.5); ++j) {
      const float power = echoes[j].share * echoes[j].part.strength;
      range += static_cast<double>(power) * echoes[j].part.range;
      sum.strength += power;
      sum.reflectivity += echoes[j].share * echoes[j].part.reflectivity;
    }
    if (sum.strength > 0.0F) sum.range = range / static_cast<double>(sum.strength);
    if (sum.strength > best.strength) best = sum;
    i = j;
  }
  return best;
}

void Lidar::cast_columns(const RayCaster& caster, int first, int count) {
  const BeamTable& b = config_.beams;
  const int rings = static_cast<int>(b.elevation.size());
  const double column_step = 1.0 / (config_.rate * b.columns);
  std::array<Eigen::Vector3d, kPacket> from;
  std::array<Eigen::Vector3d, kPacket> direction;
  RayPacket packet;
  for (int r0 = 0; r0 < rings; r0 += kTile) {
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      const int r = r0 + static_cast<int>(lane) / kTile;
      const int c = first + static_cast<int>(lane) % kTile;
      if (r >= rings || c >= first + count) {
        packet.far[lane] = -1.0F;
        continue;
      }
      const std::size_t i = index_of(r, c);
      const Pose& pose = poses_[static_cast<std::size_t>(c)];
      direction[lane].noalias() = pose.linear() * beam(i);
      from[lane] = pose.translation();
      if (b.origin_radius > 0.0) from[lane].noalias() += pose.linear() * start(i);
      if (const double late = b.time_offset[static_cast<std::size_t>(r)] / column_step; late > 0.0) {
        const Pose& next = poses_[static_cast<std::size_t>(c) + 1];
        from[lane] += late * (next.translation() - pose.translation());
        direction[lane] += late * (next.linear() * beam(i) - direction[lane]);
        direction[lane].normalize();
      }
      set_ray(packet, lane, from[lane] - caster.origin(), direction[lane], config_.max_range,
              static_cast<double>(c) / b.columns);
    }
    caster.cast(packet);
    caster.prefetch(packet);
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      const int r = r0 + static_cast<int>(lane) / kTile;
      const int c = first + static_cast<int>(lane) % kTile;
      if (r >= rings || c >= first + count) continue;
      returns_[index_of(r, c)] = shade(caster, packet, lane, from[lane], direction[lane]);
    }
  }
}

// Where the ranges of neighbours jump, the footprint may straddle an edge: four more rays tell.
void Lidar::resample_edges(const RayCaster& caster, int ring) {
  const BeamTable& b = config_.beams;
  const int rings = static_cast<int>(b.elevation.size());
  const auto at = [&](int r, int c) -> const Return& {
    return returns_[index_of(r, c < 0 ? c + b.columns : c < b.columns ? c : c - b.columns)];
  };
  const auto jumps = [&](const Return& x, const Return& y, double tolerance) {
    return std::abs(x.range - y.range) > 0.15 + tolerance * std::min(x.range, y.range);
  };
  static constexpr std::array<std::array<double, 2>, 4> kCorners{
      {{-0.35, -0.35}, {0.35, -0.35}, {0.35, 0.35}, {-0.35, 0.35}}};
  std::array<int, 4> pending{};
  std::size_t waiting = 0;
  const auto flush = [&] {
    RayPacket packet;
    std::array<Eigen::Vector3d, kPacket> from;
    std::array<Eigen::Vector3d, kPacket> direction;
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      if (lane / 4 >= waiting) {
        packet.far[lane] = -1.0F;
        continue;
      }
      const int c = pending[lane / 4];
      const Pose& pose = poses_[static_cast<std::size_t>(c)];
      const std::size_t i = index_of(ring, c);
      const Eigen::Vector3d& local = beam(i);
      const Eigen::Vector3d across = Eigen::Vector3d::UnitZ().cross(local).normalized();
      const Eigen::Vector3d up = local.cross(across);
      direction[lane] =
          pose.linear() *
          (local + config_.divergence * (kCorners[lane % 4][0] * across + kCorners[lane % 4][1] * up)).normalized();
      from[lane] = pose * start(i);
      set_ray(packet, lane, from[lane] - caster.origin(), direction[lane], config_.max_range,
              static_cast<double>(c) / b.columns);
    }
    caster.cast(packet);
    caster.prefetch(packet);
    for (std::size_t k = 0; k < waiting; ++k) {
      std::array<Echo, 5> echoes;  // by range
      std::size_t count = 0;
      const auto add = [&](const Return& r, float share) {
        if (r.range <= 0.0) return;
        std::size_t i = count++;
        for (; i > 0 && echoes[i - 1].part.range > r.range; --i) echoes[i] = echoes[i - 1];
        echoes[i] = {r, share};
      };
      add(at(ring, pending[k]), 0.36F);
      for (std::size_t lane = 4 * k; lane < 4 * k + 4; ++lane) {
        add(shade(caster, packet, lane, from[lane], direction[lane]), 0.16F);
      }
      edged_[index_of(ring, pending[k])] = strongest(std::span(echoes).first(count));
    }
    waiting = 0;
  };
  for (int c = 0; c < b.columns; ++c) {
    const Return& here = at(ring, c);
    edged_[index_of(ring, c)] = here;
    const bool edge = jumps(here, at(ring, c - 1), 0.05) || jumps(here, at(ring, c + 1), 0.05) ||
                      (ring > 0 && jumps(here, at(ring - 1, c), 0.25)) ||
                      (ring + 1 < rings && jumps(here, at(ring + 1, c), 0.25));
    if (!edge) continue;
    pending[waiting++] = c;
    if (waiting == pending.size()) flush();
  }
  if (waiting > 0) flush();
}

std::pair<Lidar::Return, double> Lidar::through(const Atmosphere& atmosphere, const Return& echo,
                                                const RandomStream& random, std::size_t index) const {
  const Pose& pose = poses_[index % static_cast<std::size_t>(config_.beams.columns)];
  const Eigen::Vector3d from = pose * start(index);
  const Eigen::Vector3d direction = pose.linear() * beam(index);
  const double limit = echo.range > 0.0 ? echo.range : config_.max_range;
  const double transmission = std::exp(-2.0 * atmosphere.depth(from, direction, limit).lidar);
  Return out = echo;
  out.strength *= static_cast<float>(transmission);
  if (!config_.noise) return {out, transmission};
  // Backscatter: a few candidate depths with speckle (exponential), the strongest may beat the wall's echo.
  Return soft;
  const std::uint64_t counter = 16 * index;
  const double reach = std::min(limit, 20.0);
  for (std::uint64_t k = 0; k < 4; ++k) {
    const double range = 0.4 * std::pow(reach / 0.4, random.uniform(counter + 4 + k));
    if (range >= limit) continue;
    const double beta = atmosphere.at(from + range * direction).backscatter;
    if (beta <= 0.0) continue;
    const double overlap = std::clamp((range - 0.4) / 1.6, 0.0, 1.0);
    const double pulse = 1.0;  // metres of scatterers that answer at once
    const double speckle = -std::log(random.uniform(counter + 8 + k));
    const auto strength = static_cast<float>(
        speckle * overlap * strength_at(std::numbers::pi * beta * pulse, range, config_.detection_range) *
        std::exp(-2.0 * atmosphere.depth(from, direction, range).lidar));
    if (strength > soft.strength) {
      soft = {range, strength, static_cast<float>(std::numbers::pi * beta * pulse * speckle)};
    }
  }
  if (soft.strength > out.strength) return {soft, 1.0};
  return {out, transmission};
}

void Lidar::detect(const Atmosphere& atmosphere, int ring, std::uint64_t frame, LidarScan& scan) const {
  const RandomStream random(seed_, 101, frame);
  const NormalTable& normal = NormalTable::instance();
  const std::size_t begin = index_of(ring, 0);
  for (std::size_t i = begin; i < begin + static_cast<std::size_t>(config_.beams.columns); ++i) {
    Return echo = config_.edges ? edged_[i] : returns_[i];
    double transmission = 1.0;
    if (!atmosphere.empty()) std::tie(echo, transmission) = through(atmosphere, echo, random, i);
    if (config_.noise) {
      // One random word: 24 bits tell detection, 32 make the two errors.
      const std::uint64_t bits = random.bits(16 * i);
      if (echo.range <= 0.0 || static_cast<float>(bits >> 40) * 0x1p-24F > detection_probability(echo.strength)) {
        echo = {};
        if (random.uniform(16 * i + 1) < config_.false_alarm) {
          echo = {random.uniform(16 * i + 2, config_.min_range, config_.max_range), 1.0F, 0.01F};
        }
      } else {
        const double weak = config_.range_sigma_weak;
        const double sigma =
            std::sqrt(config_.range_sigma * config_.range_sigma + weak * weak / static_cast<double>(echo.strength));
        echo.range += sigma * static_cast<double>(normal.at(bits));
        echo.reflectivity *= 1.0F + 0.03F * normal.at(bits >> 16);
      }
      if (config_.quantum > 0.0) {
        echo.range =
            config_.quantum * static_cast<double>(static_cast<std::int64_t>(echo.range / config_.quantum + 0.5));
      }
    }
    if (!(echo.range >= config_.min_range && echo.range <= config_.max_range && echo.range > 0.0)) {
      scan.ranges[i] = scan.reflectivity[i] = scan.signal[i] = 0.0F;
      scan.points[i] = Eigen::Vector3f::Zero();
      continue;
    }
    scan.ranges[i] = static_cast<float>(echo.range);
    scan.points[i] = (start(i) + echo.range * beam(i)).cast<float>();
    const float calibrated = echo.reflectivity * static_cast<float>(transmission);
    const float shown = calibrated <= 1.0F ? 100.0F * calibrated : 100.0F + 60.0F * std::log10(calibrated);
    scan.reflectivity[i] = static_cast<float>(static_cast<int>(std::clamp(shown, 0.0F, 255.0F) + 0.5F));
    scan.signal[i] = static_cast<float>(static_cast<std::int64_t>(100.0F * echo.strength + 0.5F));
  }
}

void Lidar::sweep(const RayCaster& caster, const Atmosphere& atmosphere, const PoseAt& pose, double time,
                  std::uint64_t frame, int threads, LidarScan& scan) {
  const BeamTable& b = config_.beams;
  const std::size_t rings = b.elevation.size();
  const auto columns = static_cast<std::size_t>(b.columns);
  scan.rings = static_cast<int>(rings);
  scan.columns = b.columns;
  scan.stamp_ns = std::llround(time * 1e9);
  scan.points.resize(rings * columns);
  scan.ranges.resize(rings * columns);
  scan.reflectivity.resize(rings * columns);
  scan.signal.resize(rings * columns);
  if (scan.time_ns.size() != rings * columns) {
    scan.time_ns.resize(rings * columns);
    for (std::size_t i = 0; i < rings * columns; ++i) {
      scan.time_ns[i] = static_cast<std::uint32_t>(
          std::llround(1e9 * (column_time(static_cast<int>(i % columns)) + b.time_offset[i / columns])));
    }
  }
  sample_poses(pose, time, column_time(1), kKnot, poses_);
  const std::size_t strips = (columns + kTile - 1) / kTile;
  parallel_for(threads, strips, [&](std::size_t strip) {
    const int first = static_cast<int>(strip) * kTile;
    cast_columns(caster, first, std::min(kTile, b.columns - first));
  });
  if (config_.edges) {
    parallel_for(threads, rings, [&](std::size_t r) { resample_edges(caster, static_cast<int>(r)); });
  }
  const Atmosphere around =
      atmosphere.empty() ? atmosphere : atmosphere.near(poses_[0].translation(), config_.max_range);
  parallel_for(threads, rings, [&](std::size_t r) { detect(around, static_cast<int>(r), frame, scan); });
}

}  // namespace adit::tunnel_simulator
