#include <cmath>
#include <cstdio>

#include "bringup/commands/file_commands.hpp"
#include "bringup/commands/sweep_folder.hpp"
#include "components/dataset/cloud_folder.hpp"
#include "components/dataset/pcd_file.hpp"
#include "components/geometry/rigid.hpp"
#include "components/mapping/map_localizer.hpp"

namespace adit {
namespace {

struct Arguments {
  std::string input, map, odometry, out, truth;
  std::vector<double> lidar_pose{0, 0, 0, 0, 0, 0, 1};
  std::vector<double> start;
  double file_rate = 10.0;
};

Result<mapping::Points> read_map(const std::string& path) {
  const Result<dataset::PointFile> file = dataset::read_pcd(path);
  if (!file) return file.error();
  mapping::Points points;
  const std::size_t columns = file->fields.size();
  for (std::size_t i = 0; i < file->points; ++i) {
    const float* row = &file->values[i * columns];
    const mapping::Point point{{row[0], row[1], row[2]}, columns > 3 ? row[3] : 0.0F};
    if (point.position.allFinite()) points.push_back(point);
  }
  if (points.empty()) return Error{ErrorCode::malformed, path + ": no finite point"};
  return points;
}

// In the frame of the map as it is: no alignment.
void print_error(const Trajectory& poses, const Trajectory& truth) {
  constexpr double degrees = 57.29577951308232;
  double metres2 = 0.0, angle2 = 0.0, worst_m = 0.0, worst_deg = 0.0;
  int count = 0;
  for (const StampedPose& pose : poses) {
    const std::optional<Pose> there = interpolate(truth, pose.stamp_ns);
    if (!there) continue;
    const Pose error = there->inverse() * pose.pose;
    const double m = error.translation().norm(), deg = degrees * so3_log(error.linear()).norm();
    metres2 += m * m;
    angle2 += deg * deg;
    worst_m = std::max(worst_m, m);
    worst_deg = std::max(worst_deg, deg);
    ++count;
  }
  if (count == 0) {
    std::printf("the truth has no pose at these times\n");
    return;
  }
  std::printf("against the truth, %d poses, not aligned: RMSE %.4f m, %.4f deg; worst %.4f m, %.4f deg\n", count,
              std::sqrt(metres2 / count), std::sqrt(angle2 / count), worst_m, worst_deg);
}

Result<void> run(const Arguments& arguments) {
  Result<dataset::Dataset> dataset = dataset::open_clouds(arguments.input, arguments.file_rate);
  if (!dataset) return dataset.error();
  const Result<Pose> mounting = pose_from_numbers(arguments.lidar_pose, "--lidar-pose");
  if (!mounting) return mounting.error();
  const Result<Trajectory> odometry = read_tum(arguments.odometry);
  if (!odometry) return odometry.error();
  std::optional<Pose> given;
  if (!arguments.start.empty()) {
    const Result<Pose> start = pose_from_numbers(arguments.start, "--start");
    if (!start) return start.error();
    given = *start;
  }
  Trajectory truth;
  if (!arguments.truth.empty()) {
    Result<Trajectory> read = read_tum(arguments.truth);
    if (!read) return read.error();
    truth = *std::move(read);
  }
  const Result<mapping::Points> map = read_map(arguments.map);
  if (!map) return map.error();

  std::optional<mapping::MapLocalizer> localizer;
  std::size_t left_out = 0;
  for (std::size_t i = 0; i < dataset->entries.size(); ++i) {
    const Result<mapping::OwnedSweep> sweep = read_sweep(*dataset, i);
    if (!sweep) return sweep.error();
    if (!localizer) {
      const std::optional<Pose> start = given ? given : interpolate(truth, mapping::end_ns(sweep->view()));
      if (!start) {
        ++left_out;
        continue;
      }
      localizer.emplace(*map, *start * *mounting);
    }
    if (!localizer->add(sweep->view(), *odometry)) ++left_out;
  }
  if (!localizer)
    return Error{ErrorCode::invalid_argument, "where does it start? Give --start, or a --truth that covers it"};
  mapping::MapLocalizer::Result result = localizer->smoothed();
  for (StampedPose& pose : result.poses) pose.pose = pose.pose * mounting->inverse();
  if (Result<void> written = write_tum(arguments.out, result.poses); !written) return written;
  std::printf(
      "%zu poses, %zu of them registered to the map (%zu switched off), overlap %.2f, residual %.3f m; %zu sweeps "
      "left out; wrote %s\n",
      result.poses.size(), result.registered, result.switched_off, result.overlap, result.rms, left_out,
      arguments.out.c_str());
  if (!truth.empty()) print_error(result.poses, truth);
  return {};
}

}  // namespace

void add_map_truth_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(file_commands::map_truth.name, file_commands::map_truth.description);
  command->add_option("--input", arguments->input, "folder of clouds (components/dataset/README.md)")->required();
  command->add_option("--map", arguments->map, "the map (.pcd)")->required()->check(CLI::ExistingFile);
  command
      ->add_option("--odometry", arguments->odometry,
                   "the LiDAR's poses by an odometry (TUM), e.g. `adit odometry lidar`")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--out", arguments->out, "TUM file to write: poses in the map at the ends of the sweeps")
      ->required();
  command
      ->add_option("--lidar-pose", arguments->lidar_pose,
                   "of the LiDAR in the frame whose poses --truth, --start and --out have: x y z qx qy qz qw")
      ->expected(7);
  command->add_option("--start", arguments->start, "first pose in the map, to 1 m and 5 degrees: x y z qx qy qz qw")
      ->expected(7);
  command
      ->add_option("--truth", arguments->truth,
                   "true poses in the map (TUM): the error is printed, and without "
                   "--start they say where the drive starts")
      ->check(CLI::ExistingFile);
  command->add_option("--file-rate", arguments->file_rate, "of folders without stamps [Hz]")->capture_default_str();
  command->callback([arguments, &code] {
    if (Result<void> done = run(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
