#include <cstdio>

#include "bringup/commands/file_commands.hpp"
#include "bringup/commands/sweep_folder.hpp"
#include "components/dataset/cloud_folder.hpp"
#include "components/geometry/rigid.hpp"
#include "components/mapping/map_file.hpp"
#include "components/mapping/mapper.hpp"

namespace adit {
namespace {

struct Arguments {
  std::string input, odometry, map, trajectory;
  std::vector<double> lidar_pose{0, 0, 0, 0, 0, 0, 1};
  bool surveyed = false;
  double voxel = 0.3;
  double file_rate = 10.0;
};

// The poses of the LiDAR, from those of the body it is mounted on.
Trajectory of_sensor(Trajectory body, const Pose& mounting) {
  for (StampedPose& pose : body) pose.pose = pose.pose * mounting;
  return body;
}

Result<void> run(const Arguments& arguments) {
  Result<dataset::Dataset> dataset = dataset::open_clouds(arguments.input, arguments.file_rate);
  if (!dataset) return dataset.error();
  const Result<Pose> mounting = pose_from_numbers(arguments.lidar_pose, "--lidar-pose");
  if (!mounting) return mounting.error();
  Result<Trajectory> read = read_tum(arguments.odometry);
  if (!read) return read.error();
  const Trajectory odometry = of_sensor(*std::move(read), *mounting);

  mapping::Config config;
  // Surveyed poses are the map's: nothing is closed, every cloud serves.
  if (arguments.surveyed) config.revisit_gap = 1e12;
  mapping::Mapper mapper(config);
  for (std::size_t i = 0; i < dataset->entries.size(); ++i) {
    const Result<mapping::OwnedSweep> sweep = read_sweep(*dataset, i);
    if (!sweep) return sweep.error();
    mapper.add(sweep->view(), odometry);
  }
  mapper.finish();
  const mapping::Points points = mapper.global_map(arguments.voxel);
  if (Result<void> written = mapping::write_map(arguments.map, points); !written) return written;
  if (!arguments.trajectory.empty()) {
    const Trajectory keyframes = of_sensor(mapper.trajectory(), mounting->inverse());
    if (Result<void> written = write_tum(arguments.trajectory, keyframes); !written) return written;
  }
  const mapping::Counters& counters = mapper.counters();
  std::printf("%zu keyframes from %lu sweeps (%lu without odometry or points), %lu closures; wrote %zu points to %s\n",
              mapper.graph().size(), counters.sweeps, counters.refused_sweeps, counters.closures, points.size(),
              arguments.map.c_str());
  return {};
}

}  // namespace

void add_map_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(file_commands::map.name, file_commands::map.description);
  command->add_option("--input", arguments->input, "folder (components/dataset/README.md)")->required();
  command->add_option("--odometry", arguments->odometry, "poses (TUM), e.g. of `adit odometry lidar`")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--out", arguments->map, "map to write: .pcd or .ply")->required();
  command->add_option("--trajectory", arguments->trajectory, "keyframes in the map, to write (TUM)");
  command
      ->add_option("--lidar-pose", arguments->lidar_pose, "of the LiDAR in the frame of the poses: x y z qx qy qz qw")
      ->expected(7);
  command->add_flag("--surveyed", arguments->surveyed, "the poses are the truth: no loop is closed");
  command->add_option("--voxel", arguments->voxel, "of the map [m]")
      ->check(CLI::Range(0.05, 10.0))
      ->capture_default_str();
  command->add_option("--file-rate", arguments->file_rate, "of folders without stamps [Hz]")->capture_default_str();
  command->callback([arguments, &code] {
    if (Result<void> done = run(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
