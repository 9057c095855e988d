#pragma once
// The range images of a drive log, assembled exactly as rosid does.

#include <filesystem>
#include <functional>

#include "base/result.hpp"
#include "config/loader.hpp"
#include "mapping/range_image.hpp"

namespace rosid::rosi {

/// Replays the log and calls visit for every finished image in order, until it returns false.
Result<void> for_each_image(const std::filesystem::path& log,
                            const std::function<bool(const mapping::RangeImage&)>& visit);

/// Configuration the log was recorded with; every issue stands in the error.
Result<config::RosidConfig> config_of_log(const std::filesystem::path& log);

}  // namespace rosid::rosi
