#include "tools/rosi/log_images.hpp"

#include <string>
#include <variant>

#include "daemon/replay.hpp"
#include "msgs/log.hpp"

namespace rosid::rosi {

Result<void> for_each_image(const std::filesystem::path& log,
                            const std::function<bool(const mapping::RangeImage&)>& visit) {
  daemon::ReplayOptions options;
  options.on_image = visit;
  const auto replayed = daemon::run_replay(log, options);
  if (!replayed) { return tl::unexpected<Error>(replayed.error()); }
  return {};
}

Result<config::RosidConfig> config_of_log(const std::filesystem::path& log) {
  auto reader = msgs::LogReader::open(log);
  if (!reader) { return tl::unexpected<Error>(reader.error()); }
  while (const auto record = reader->next()) {
    const auto* text = std::get_if<msgs::ConfigRecord>(&record->body);
    if (text == nullptr) { continue; }
    auto config = config::parse_rosid(text->toml, log.string() + " (configuration in the log)");
    if (config) { return std::move(*config); }
    std::string message = "the configuration in the log cannot be used:";
    for (const config::Issue& issue : config.error()) { message += "\n" + config::to_string(issue); }
    return make_error(ErrorCode::Format, message);
  }
  return make_error(ErrorCode::Format, "'" + log.string() + "' holds no configuration record");
}

}  // namespace rosid::rosi
