// Table, summary.json and report.html of a folder that a run left: what `adit evaluate --folder` and `adit run-offline`
// end with.
#pragma once

#include <string>

#include "bringup/evaluation/evaluation.hpp"
#include "bringup/evaluation/report.hpp"
#include "bringup/evaluation/run_folder.hpp"
#include "idl/result.hpp"

namespace adit {

// Sets cpu_s of the evaluations from the figures of a run (`adit run --summary`), by the component's name.
Result<void> add_run_figures(const std::string& run_path, std::vector<evaluation::Evaluation>& evaluations);

// Prints the tables and writes DIR/summary.json and DIR/report.html; nothing is written when `out` is empty.
// `run_path`: the figures of the run, merged into the summary; empty: none.
Result<void> report_evaluations(const evaluation::RunFolder& run, const evaluation::ReportOptions& options,
                                const std::string& run_path, const std::string& out);

}  // namespace adit
