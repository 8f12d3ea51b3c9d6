// The files that one run of a deployment leaves behind, evaluated together.
#pragma once

#include <string>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"
#include "bringup/evaluation/fusion_log.hpp"
#include "idl/result.hpp"

namespace adit::evaluation {

struct RunFolder {
  Trajectory truth;
  std::vector<Evaluation> evaluations;  // front ends first, the fused ones last
  std::vector<FusionLog> fusion;
};

// One estimate: its figures, with NEES when a .cov file stands beside its .tum file.
Result<Evaluation> evaluate_file(const std::string& name, const std::string& path, const Trajectory& truth,
                                 const Options& options);

// truth.tum is the truth, every other NAME.tum an estimate of that name, NAME.csv its fusion log. An estimate without a
// pose in common with the truth counts as one that delivered nothing.
Result<RunFolder> evaluate_folder(const std::string& folder, const Options& options);

}  // namespace adit::evaluation
