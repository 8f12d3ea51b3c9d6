// The deployments that are shipped: their components exist, their parameters and links fit, for every vehicle.
#include <gtest/gtest.h>

#include "bringup/deployment/deployment.hpp"

namespace adit {
namespace {

class ShippedDeployment : public ::testing::TestWithParam<const char*> {};

TEST_P(ShippedDeployment, IsFine) {
  for (const char* vehicle : {"car", "legged"}) {
    DeploymentOverrides overrides;
    overrides.variables = {{"SCENARIO", "scenario.yaml"}, {"OUT", "out"}, {"VEHICLE", vehicle}};
    const std::string path = std::string(ADIT_SOURCE_DIR) + "/bringup/deployments/" + GetParam();
    const Result<Deployment> deployment = load_deployment(path, overrides);
    ASSERT_TRUE(deployment) << deployment.error().message;
    const Result<std::vector<std::string>> findings = check_links(*deployment);
    ASSERT_TRUE(findings) << findings.error().message;
    for (const std::string& finding : *findings) ADD_FAILURE() << finding;
  }
}

INSTANTIATE_TEST_SUITE_P(All, ShippedDeployment,
                         ::testing::Values("paper.yaml", "default.yaml", "robot.yaml", "experiment.yaml",
                                           "ablation.yaml", "simulator.yaml", "mapping.yaml"),
                         [](const ::testing::TestParamInfo<const char*>& shipped) {
                           const std::string name = shipped.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace adit
