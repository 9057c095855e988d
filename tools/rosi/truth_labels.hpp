#pragma once
// True surface of every raster pixel of every view of a simulated drive.

#include <filesystem>

#include "base/calibration.hpp"
#include "base/result.hpp"
#include "sim/simulated_plant.hpp"

namespace rosid::rosi {

/// Assembles the views of the log as rosid does and writes FOLDER/view_KKKK.u16 (little-endian 16-bit surface ids, line
/// after line, 0 where the beam meets nothing) and FOLDER/index.json (lines, columns, reference time of each view, and
/// what each surface id is). drive_start is the log time of the plant's time 0.
Result<void> write_truth_labels(const std::filesystem::path& log, const Calibration& calibration,
                                const sim::SimulatedPlant& plant, Time drive_start,
                                const std::filesystem::path& folder);

}  // namespace rosid::rosi
