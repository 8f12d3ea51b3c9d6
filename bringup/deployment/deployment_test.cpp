#include "bringup/deployment/deployment.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "components/runtime/component.hpp"
#include "std_msgs/msg/string.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;
using std_msgs::msg::String;
using testing::HasSubstr;

class Speaker final : public Component {
  Param<double> rate_{*this, "rate", 1.0, Unit::hertz, Range{0.1, 100.0}};
  Output<String> out_{*this, "chatter", Qos::sensor()};
};
ADIT_COMPONENT(Speaker, "test_speaker");

class Hearer final : public Component {
  Input<String> in_{*this, "chatter", Qos::reliable(), Queue{2, WhenFull::drop_oldest},
                    [](const String&, const MessageInfo&) {}};
};
ADIT_COMPONENT(Hearer, "test_hearer");

class DeploymentTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("adit_deployment_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  Result<Deployment> load(const std::string& text, const DeploymentOverrides& overrides = {}) const {
    return load_deployment(write("d.yaml", text), overrides);
  }

  std::filesystem::path folder_;
};

TEST_F(DeploymentTest, ReadsEverythingOfTheFormat) {
  write("params.yaml", "/**:\n  ros__parameters: {rate: 5.0}\nspeaker:\n  ros__parameters: {rate: 7}\n");
  const Result<Deployment> deployment = load(R"(
domain: 7
middleware: {vendor: cyclonedds, network: loopback, ros_distro: humble, peers: [127.0.0.1]}
parameter_files: [params.yaml]
use_sim_time: true
processes:
  - name: perception
    middleware: fastdds
    restart: {policy: always, max: 3, backoff: 1s}
    executor: {threads: 2, priority: 20, cpus: [1], lock_memory: true}
    when_done: stop_all
    stop_timeout: 250ms
    environment: {A: b}
    components:
      - {type: test_speaker, name: speaker, namespace: /ns, remap: {chatter: /words}}
      - {type: test_hearer, inputs: {chatter: {queue: 4, when_full: block}}, log_level: debug}
)");
  ASSERT_TRUE(deployment) << deployment.error().message;
  ASSERT_EQ(deployment->processes.size(), 1u);
  const DeployedProcess& p = deployment->processes[0];
  EXPECT_EQ(p.process.middleware.vendor, "fastdds");
  EXPECT_EQ(p.process.middleware.domain, 7u);
  EXPECT_EQ(p.process.middleware.ros_distro, "humble");
  EXPECT_TRUE(p.process.use_sim_time);
  EXPECT_EQ(p.process.executor.threads, 2);
  EXPECT_EQ(p.process.executor.cpus, std::vector<int>{1});
  EXPECT_EQ(p.restart.when, RestartPolicy::When::always);
  EXPECT_EQ(p.restart.backoff, 1s);
  EXPECT_TRUE(p.stops_all);
  EXPECT_EQ(p.stop_timeout, 250ms);
  EXPECT_EQ(p.environment.at("A"), "b");
  ASSERT_EQ(p.process.components.size(), 2u);
  EXPECT_EQ(p.process.components[0].remap.at("chatter"), "/words");
  EXPECT_EQ(p.process.components[1].name, "test_hearer");
  EXPECT_EQ(p.process.components[1].inputs.at("chatter").queue, 4u);
  const Value::Map& parameters = std::get<Value::Map>(p.process.components[0].parameters.content);
  ASSERT_EQ(parameters.size(), 1u);
  EXPECT_EQ(std::get<std::int64_t>(parameters[0].second.content), 7);
}

TEST_F(DeploymentTest, ErrorsCarryFileAndLine) {
  const Result<Deployment> deployment = load(
      "domain: 300\nmiddleware: {vendor: zenoh}\nproceses: []\nprocesses:\n  - name: a\n    components: [{type: "
      "test_speaker, remaps: {}}]\n");
  ASSERT_FALSE(deployment);
  const std::string& message = deployment.error().message;
  EXPECT_THAT(message, HasSubstr("d.yaml:1: 'domain' must lie in [0, 232]"));
  EXPECT_THAT(message, HasSubstr("d.yaml:2: 'vendor' must be one of fastdds, cyclonedds, not 'zenoh'"));
  EXPECT_THAT(message, HasSubstr("d.yaml:3: unknown key 'proceses'"));
  EXPECT_THAT(message, HasSubstr("d.yaml:6: unknown key 'remaps'"));
}

TEST_F(DeploymentTest, UnknownComponentParameterAndInputAreRefused) {
  const auto with = [&](const std::string& component) {
    const Result<Deployment> deployment = load("processes:\n  - name: a\n    components:\n      - " + component + "\n");
    EXPECT_FALSE(deployment) << component;
    return deployment ? std::string() : deployment.error().message;
  };
  EXPECT_THAT(with("{type: no_such_component}"), HasSubstr("no_such_component"));
  EXPECT_THAT(with("{type: test_speaker, parameters: {speed: 3}}"), HasSubstr("rate"));
  EXPECT_THAT(with("{type: test_speaker, parameters: {rate: 1000.0}}"), HasSubstr("d.yaml:4"));
  EXPECT_THAT(with("{type: test_speaker, parameters: {rate: fast}}"), HasSubstr("d.yaml:4"));
  EXPECT_THAT(with("{type: test_hearer, inputs: {chater: {queue: 1}}}"), HasSubstr("chat"));
}

TEST_F(DeploymentTest, NamesMustBeUnique) {
  EXPECT_FALSE(
      load("processes:\n  - {name: a, components: [{type: test_speaker}]}\n  - {name: a, components: [{type: "
           "test_hearer}]}\n"));
  EXPECT_FALSE(
      load("processes:\n  - {name: a, components: [{type: test_speaker}]}\n  - {name: b, components: [{type: "
           "test_speaker}]}\n"));
  EXPECT_FALSE(load("processes: []\n"));
  EXPECT_FALSE(load_deployment((folder_ / "absent.yaml").string()));
}

TEST_F(DeploymentTest, VariablesComeFromTheCommandLineThenTheirDefault) {
  DeploymentOverrides overrides;
  overrides.variables["SPEED"] = "5";
  overrides.middleware = "cyclonedds";
  overrides.domain = 9;
  const std::string text =
      "processes:\n  - name: a\n    components:\n      - {type: test_speaker, parameters: {rate: ${SPEED}}, name: "
      "\"${NAME:-someone}\"}\n";
  const Result<Deployment> deployment = load(text, overrides);
  ASSERT_TRUE(deployment) << deployment.error().message;
  EXPECT_EQ(deployment->processes[0].process.components[0].name, "someone");
  EXPECT_EQ(deployment->processes[0].process.middleware.vendor, "cyclonedds");
  EXPECT_EQ(deployment->processes[0].process.middleware.domain, 9u);
  const Result<Deployment> without = load(text);
  ASSERT_FALSE(without);
  EXPECT_THAT(without.error().message, HasSubstr("d.yaml:4: 'SPEED' has no value"));
}

TEST_F(DeploymentTest, LinksThatCannotWorkAreFoundBeforeLaunch) {
  const Result<Deployment> deployment = load(
      "processes:\n  - {name: a, components: [{type: test_speaker}]}\n  - {name: b, components: [{type: "
      "test_hearer}]}\n");
  ASSERT_TRUE(deployment) << deployment.error().message;
  const Result<std::vector<std::string>> findings = check_links(*deployment);
  ASSERT_TRUE(findings);
  ASSERT_EQ(findings->size(), 1u);
  EXPECT_THAT(findings->front(), HasSubstr("/chatter: /test_speaker -> /test_hearer: reliability offered best effort"));

  const Result<Deployment> mended = load(
      "processes:\n  - {name: a, components: [{type: test_speaker}]}\n  - {name: b, components: [{type: "
      "test_hearer, inputs: {chatter: {reliability: best_effort}}}]}\n");
  ASSERT_TRUE(mended) << mended.error().message;
  EXPECT_TRUE(check_links(*mended)->empty());
}

}  // namespace
}  // namespace adit
