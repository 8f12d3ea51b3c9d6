// The commands a user types, against a running deployment and against mistakes.
#include <gmock/gmock.h>
#include <signal.h>

#include "components/geometry/trajectory.hpp"
#include "tests/integration/adit_process.hpp"

namespace adit::integration {
namespace {

using testing::HasSubstr;

constexpr const char* talking = R"(
processes:
  - name: talking
    components: [{type: talker, parameters: {rate: 50.0}}]
  - name: listening
    components: [{type: listener}]
)";

class Commands : public testing::TestWithParam<const char*> {
 protected:
  std::vector<std::string> with_options(std::vector<std::string> words) const {
    for (const char* word : {"--middleware", GetParam(), "--domain"}) words.emplace_back(word);
    words.push_back(domain_);
    return words;
  }
  std::string domain_ = private_domain();
  TemporaryFolder folder_;
};

TEST_P(Commands, TopicAndNodeToolsSeeARunningDeployment) {
  Background run(with_options({"run", folder_.write("talk.yaml", talking), "--quiet"}), folder_.file("log"));

  // Retried: the deployment is still coming up.
  EXPECT_TRUE(wait_until(20.0, [&] {
    return run_adit(with_options({"topic", "list"})).text.find("/chatter") != std::string::npos;
  }));
  const Output nodes = run_adit(with_options({"node", "list"}));
  EXPECT_THAT(nodes.text, HasSubstr("/talker"));
  EXPECT_THAT(nodes.text, HasSubstr("/listener"));
  const Output node = run_adit(with_options({"node", "info", "/talker"}));
  EXPECT_THAT(node.text, HasSubstr("writes /chatter  std_msgs/msg/String"));
  const Output info = run_adit(with_options({"topic", "info", "/chatter"}));
  EXPECT_THAT(info.text, HasSubstr("writer /talker"));
  EXPECT_THAT(info.text, HasSubstr("reader /listener"));
  EXPECT_THAT(info.text, HasSubstr("RIHS01_"));
  const Output echo = run_adit(with_options({"topic", "echo", "/chatter", "-n", "3", "--duration", "10"}));
  EXPECT_EQ(echo.exit_code, 0) << echo.text;
  EXPECT_THAT(echo.text, HasSubstr("Hello World"));
  const Output hz = run_adit(with_options({"topic", "hz", "/chatter", "--duration", "2"}));
  EXPECT_EQ(hz.exit_code, 0) << hz.text;
  const std::size_t at = hz.text.find("average rate ");
  ASSERT_NE(at, std::string::npos) << hz.text;
  EXPECT_NEAR(std::stod(hz.text.substr(at + 13)), 50.0, 10.0) << hz.text;
  EXPECT_THAT(run_adit(with_options({"topic", "bw", "/chatter", "-n", "20", "--duration", "10"})).text,
              HasSubstr("B/s"));
  const Output delay = run_adit(with_options({"topic", "delay", "/diagnostics", "-n", "2", "--duration", "10"}));
  EXPECT_EQ(delay.exit_code, 0) << delay.text;

  run.signal(SIGINT);
  EXPECT_EQ(run.wait(20.0), 0);
}

TEST_P(Commands, MistakesGetOneClearLine) {
  const Output topic = run_adit(with_options({"topic", "echo", "/nothing", "--wait", "0.5"}));
  EXPECT_NE(topic.exit_code, 0);
  EXPECT_THAT(topic.text, HasSubstr("nobody writes '/nothing'"));
  const Output node = run_adit(with_options({"node", "info", "/nobody", "--wait", "0.5"}));
  EXPECT_NE(node.exit_code, 0);
  const Output network = run_adit(with_options({"explain", "--network", "nope0"}));
  EXPECT_NE(network.exit_code, 0);
  EXPECT_THAT(network.text, HasSubstr("nope0"));
}

TEST_P(Commands, ExplainAndDoctorLookAtThisMachine) {
  const Output explain = run_adit(with_options({"explain"}));
  EXPECT_EQ(explain.exit_code, 0) << explain.text;
  EXPECT_THAT(explain.text, HasSubstr("127.0.0.1"));
  const Output doctor = run_adit(with_options({"doctor"}));
  EXPECT_EQ(doctor.exit_code, 0) << doctor.text;
  EXPECT_THAT(doctor.text, HasSubstr(std::string("ok    middleware ") + GetParam()));
}

// A recording of a running deployment, heard again from the bag alone; a recording that is killed is a bag all the
// same.
TEST_P(Commands, RecordedTopicsPlayAgain) {
  const std::string bag = folder_.file("bag"), killed_bag = folder_.file("killed");
  {
    Background run(with_options({"run", folder_.write("talk.yaml", talking), "--quiet"}), folder_.file("log"));
    Background killed(with_options({"record", "/chatter", "--out", killed_bag}), folder_.file("killed_log"));
    // Long enough to be discovered on a loaded machine.
    const Output recorded = run_adit(with_options({"record", "--all", "--out", bag, "--duration", "8"}));
    EXPECT_EQ(recorded.exit_code, 0) << recorded.text;
    EXPECT_THAT(recorded.text, HasSubstr("/chatter"));
    EXPECT_THAT(recorded.text, HasSubstr("/diagnostics"));
    killed.signal(SIGKILL);
    EXPECT_NE(killed.wait(5.0), -1);
    const Output again = run_adit(with_options({"record", "/chatter", "--out", bag}));
    EXPECT_EQ(again.exit_code, 1);
    EXPECT_THAT(again.text, HasSubstr("exists"));
    run.signal(SIGINT);
    EXPECT_EQ(run.wait(20.0), 0);
  }
  for (const std::string& recording : {bag, killed_bag}) {
    Background play(with_options({"play", recording, "--topic", "/chatter", "--remap", "/chatter:=/again", "--loop"}),
                    folder_.file("play_log"));
    const Output echo =
        run_adit(with_options({"topic", "echo", "/again", "-n", "3", "--wait", "20", "--duration", "20"}));
    EXPECT_EQ(echo.exit_code, 0) << echo.text;
    EXPECT_THAT(echo.text, HasSubstr("Hello World"));
    play.signal(SIGINT);
    EXPECT_EQ(play.wait(20.0), 0);
  }
}

INSTANTIATE_TEST_SUITE_P(Vendors, Commands, testing::Values("fastdds", "cyclonedds"),
                         [](const auto& vendor) { return std::string(vendor.param); });

// A walking robot's clouds and inertial samples, as files and as a bag: the same poses, close to the truth.
TEST(OdometryOffline, TakesTheImuOfAFolderAndOfABag) {
  const std::string scenario = std::string(ADIT_SOURCE_DIR) + "/bringup/scenarios/s15_adit.yaml";
  const TemporaryFolder folder;
  for (const char* format : {"folder", "bag"}) {
    const Output made = run_adit({"simulate", scenario, "--duration", "4", "--columns", "256", "--sensors", "lidar,imu",
                                  "--format", format, "--out", folder.file(format)});
    ASSERT_EQ(made.exit_code, 0) << made.text;
  }
  const std::string parameters = folder.write("imu.yaml", R"(
lidar_odometry:
  ros__parameters:
    use_imu: true
    lidar_pose: [0.10, 0.0, 0.85, 0.0, 0.0, 0.0, 1.0]
    imu_pose: [0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]
)");
  const Output of_folder = run_adit({"odometry", "lidar", "--input", folder.file("folder"), "--imu",
                                     folder.file("folder/imu.csv"), "--out", folder.file("folder.tum")});
  ASSERT_EQ(of_folder.exit_code, 0) << of_folder.text;
  EXPECT_THAT(of_folder.text, HasSubstr("40 of 40 clouds have a pose"));
  EXPECT_EQ(of_folder.text.find("without IMU"), std::string::npos) << of_folder.text;
  const Output of_bag = run_adit(
      {"odometry", "lidar", "--input", folder.file("bag"), "--config", parameters, "--out", folder.file("bag.tum")});
  ASSERT_EQ(of_bag.exit_code, 0) << of_bag.text;
  EXPECT_EQ(of_bag.text.find("without IMU"), std::string::npos) << of_bag.text;

  const Result<Trajectory> truth = read_tum(folder.file("folder/gt_end.tum"));
  const Result<Trajectory> files = read_tum(folder.file("folder.tum")), bag = read_tum(folder.file("bag.tum"));
  ASSERT_TRUE(truth && files && bag);
  ASSERT_EQ(files->size(), bag->size());
  ASSERT_EQ(files->size(), truth->size());
  for (std::size_t i = 0; i < files->size(); ++i) {
    const Pose expected = truth->front().pose.inverse() * (*truth)[i].pose;
    EXPECT_LT((files->front().pose.inverse() * (*files)[i].pose.translation() - expected.translation()).norm(), 0.03)
        << i;
    EXPECT_LT(((*files)[i].pose.translation() - (*bag)[i].pose.translation()).norm(), 0.005) << i;
  }
  const Output missing = run_adit({"odometry", "lidar", "--input", folder.file("folder"), "--imu", "/nowhere.csv",
                                   "--out", folder.file("none.tum")});
  EXPECT_NE(missing.exit_code, 0);
  EXPECT_THAT(missing.text, HasSubstr("/nowhere.csv"));
}

TEST(Run, BadDeploymentsAreRefusedWithFileAndLine) {
  const TemporaryFolder folder;
  struct Case {
    const char* text;
    const char* expected;
  };
  const Case cases[] = {
      {"processes:\n  - name: a\n    components: [{type: no_such_thing}]\n", "no_such_thing"},
      {"processes:\n  - name: a\n    components: [{type: talker, parameters: {rate: often}}]\n", "bad.yaml:3"},
      {"procesess: []\n", "bad.yaml:1: unknown key 'procesess'"},
      {"middleware: {vendor: opendds}\nprocesses: []\n", "bad.yaml:1: 'vendor' must be one of"},
      {"processes: [\n", "bad.yaml:"},
  };
  for (const Case& c : cases) {
    const Output output = run_adit({"run", folder.write("bad.yaml", c.text)});
    EXPECT_EQ(output.exit_code, 1) << c.text;
    EXPECT_THAT(output.text, HasSubstr(c.expected)) << c.text;
  }
  EXPECT_NE(run_adit({"run", "/nonexistent.yaml"}).exit_code, 0);
  EXPECT_NE(run_adit({"frobnicate"}).exit_code, 0);
  const Output vendor = run_adit({"explain", "--middleware", "opendds"});
  EXPECT_EQ(vendor.exit_code, 1);
  EXPECT_THAT(vendor.text, HasSubstr("fastdds"));
}

}  // namespace
}  // namespace adit::integration
