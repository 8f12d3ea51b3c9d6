// A deployment on a scenario or a recording, in this process and without DDS.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "bringup/deployment/deployment.hpp"
#include "bringup/evaluation/report.hpp"
#include "bringup/evaluation/run_folder.hpp"
#include "bringup/offline/source.hpp"
#include "components/runtime/status.hpp"

namespace adit::offline {

struct RunRequest {
  std::string deployment;
  DeploymentOverrides overrides;    // OUT and SCENARIO are set when they are not given
  std::string input;                // scenario file, bag or folder: instead of the deployment's sources
  std::string out;                  // folder, made when it is not there
  SourceOptions source;             // its topics are found by the run
  std::vector<std::string> record;  // topics of the components and of a simulated input, for the bag OUT/bag
};

struct RunOutcome {
  OfflineStats messages;
  std::vector<ComponentStatus> components;  // as they were at the end
  double simulated_s = 0.0, wall_s = 0.0;
  std::string run_path;  // OUT/run.json: CPU and wall time, as `adit run --summary` writes them
};

// The components of all processes of the deployment but its sources, fed with the input; they write into `out`. Two
// runs of the same request write the same bytes (but run.json, which has times).
Result<RunOutcome> run(const RunRequest& request);

// What a run left in `folder`, with figures of `run_path`; `report` gets what the scenario says. Error: no truth.tum
// there.
Result<evaluation::RunFolder> evaluate_run(const std::string& folder, const std::string& input,
                                           evaluation::ReportOptions& report);

}  // namespace adit::offline
