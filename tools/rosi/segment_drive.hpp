#pragma once
// All views of a drive log through the segmenter.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "base/result.hpp"
#include "tools/rosi/segment_truth.hpp"

namespace rosid::rosi {

/// Segments every view as `rosi segment LOG --view K` does, and scores it when there is a truth. The object has
/// "views", "patches", "valid", "coverage_fraction", "rms_mm", "times_ms" (CPU time of each view), "time_ms" (their
/// median) and with a truth "score" of SegmentationScore. Errors: the log, the labels, or a log without a single view.
Result<nlohmann::json> segment_drive(const std::filesystem::path& log, const TruthSource* truth);

/// That object for people.
std::string describe_drive(const nlohmann::json& report);

/// CPU time this program has used, milliseconds: what else the machine does is not counted.
double cpu_time_ms();

/// Median; the upper of the two in the middle. Precondition: not empty.
double median(std::vector<double> values);

}  // namespace rosid::rosi
