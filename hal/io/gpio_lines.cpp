// GPIO lines by libgpiod 2.

#include <fcntl.h>
#include <fmt/format.h>
#include <gpiod.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/io/edge_source.hpp"
#include "hal/io/errno_text.hpp"
#include "hal/io/support.hpp"

namespace rosid::hal {

namespace {

template <auto Release>
struct Releaser {
  template <typename T>
  void operator()(T* object) const {
    Release(object);
  }
};
using Chip = std::unique_ptr<gpiod_chip, Releaser<gpiod_chip_close>>;
using ChipInfo = std::unique_ptr<gpiod_chip_info, Releaser<gpiod_chip_info_free>>;
using LineInfo = std::unique_ptr<gpiod_line_info, Releaser<gpiod_line_info_free>>;
using Settings = std::unique_ptr<gpiod_line_settings, Releaser<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Releaser<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Releaser<gpiod_request_config_free>>;
using Request = std::unique_ptr<gpiod_line_request, Releaser<gpiod_line_request_release>>;
using Buffer = std::unique_ptr<gpiod_edge_event_buffer, Releaser<gpiod_edge_event_buffer_free>>;

// The most the kernel gives, whatever is asked for.
constexpr std::size_t kKernelBuffer = 1024;
constexpr std::size_t kBatch = 64;

using Offsets = std::vector<unsigned>;

Error errno_error(int code, const std::string& what) {
  switch (code) {
    case EACCES:
    case EPERM:
      return {
          ErrorCode::PermissionDenied,
          fmt::format("{}: not permitted; the user must be in the group of the chip (gpio, see 60-rosid.rules)", what)};
    case ENOENT:
    case ENODEV:
    case ENXIO: return {ErrorCode::NotFound, fmt::format("{}: {}", what, errno_text(code))};
    default: return {ErrorCode::Io, fmt::format("{}: {}", what, errno_text(code))};
  }
}

/// A chip that is given by its path may have any name, for example a link that udev keeps.
std::vector<std::string> chip_paths(const std::string& wanted) {
  if (wanted.starts_with('/')) { return {wanted}; }
  std::vector<std::string> paths;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("gpiochip")) { paths.push_back(entry.path().string()); }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

bool is_named(gpiod_chip* chip, const std::string& path, const std::string& wanted) {
  if (wanted.empty() || path == wanted) { return true; }
  const ChipInfo info(gpiod_chip_get_info(chip));
  return info && (gpiod_chip_info_get_name(info.get()) == wanted || gpiod_chip_info_get_label(info.get()) == wanted);
}

std::optional<unsigned> offset_of(gpiod_chip* chip, const std::string& line) {
  if (is_line_offset(line)) {
    unsigned offset = 0;
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), offset);
    const ChipInfo info(gpiod_chip_get_info(chip));
    const bool is_there = error == std::errc{} && info && offset < gpiod_chip_info_get_num_lines(info.get());
    return is_there ? std::optional(offset) : std::nullopt;
  }
  const int offset = gpiod_chip_get_line_offset_from_name(chip, line.c_str());
  return offset < 0 ? std::nullopt : std::optional(static_cast<unsigned>(offset));
}

std::vector<std::string> wanted_lines(const GpioConfig& config) {
  std::vector<std::string> lines{config.line_a, config.line_b};
  if (!config.line_z.empty()) { lines.push_back(config.line_z); }
  return lines;
}

struct Found {
  Chip chip;
  std::string path;
  Offsets offsets;
};

/// Looks at every chip, so that the message can say what is wrong.
class Search {
 public:
  explicit Search(const GpioConfig& config) : config_(config), lines_(wanted_lines(config)), seen_(lines_.size()) {}

  Result<Found> run() {
    for (const std::string& path : chip_paths(config_.chip)) { look_at(path); }
    if (matches_.size() == 1) { return std::move(matches_.front()); }
    return tl::make_unexpected(why());
  }

 private:
  void look_at(const std::string& path) {
    Chip chip(gpiod_chip_open(path.c_str()));
    if (!chip) {
      if (!refusal_) { refusal_ = errno_error(errno, path); }
      return;
    }
    if (!is_named(chip.get(), path, config_.chip)) { return; }
    ++chips_;
    Offsets offsets;
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      if (const auto offset = offset_of(chip.get(), lines_[k])) {
        offsets.push_back(*offset);
        seen_[k] = true;
      }
    }
    if (offsets.size() == lines_.size()) { matches_.push_back({std::move(chip), path, std::move(offsets)}); }
  }

  Error why() const {
    if (matches_.size() > 1) {
      return {ErrorCode::InvalidArgument,
              fmt::format("{} and {} both have lines of these names; name the chip in gpio.chip", matches_[0].path,
                          matches_[1].path)};
    }
    if (chips_ == 0) {
      if (refusal_) { return *refusal_; }
      return {ErrorCode::NotFound,
              config_.chip.empty() ? "no GPIO chip in /dev; is its driver loaded, the adapter plugged in?"
                                   : fmt::format("no GPIO chip '{}'; gpiodetect lists those there are", config_.chip)};
    }
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      if (!seen_[k]) {
        return {ErrorCode::NotFound, fmt::format("no GPIO line '{}'{}; gpioinfo lists those there are", lines_[k],
                                                 config_.chip.empty() ? "" : " on " + config_.chip)};
      }
    }
    return {ErrorCode::InvalidArgument,
            "the GPIO lines of the turret must all be on one chip; gpioinfo shows where they are"};
  }

  const GpioConfig& config_;
  std::vector<std::string> lines_;
  std::vector<bool> seen_;
  std::vector<Found> matches_;
  std::optional<Error> refusal_;
  int chips_ = 0;
};

/// Who has a line that was refused as busy.
Error busy_error(const Found& found, const std::vector<std::string>& lines) {
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const LineInfo info(gpiod_chip_get_line_info(found.chip.get(), found.offsets[k]));
    if (!info || !gpiod_line_info_is_used(info.get())) { continue; }
    const char* consumer = gpiod_line_info_get_consumer(info.get());
    return {ErrorCode::Busy, fmt::format("GPIO line '{}' of {} is in use by '{}'; gpioinfo shows it", lines[k],
                                         found.path, consumer == nullptr ? "the kernel" : consumer)};
  }
  return {ErrorCode::Busy, fmt::format("a GPIO line of {} is in use; gpioinfo shows by whom", found.path)};
}

Result<Request> request_lines(const Found& found, const GpioConfig& config) {
  const Settings settings(gpiod_line_settings_new());
  const LineConfig lines(gpiod_line_config_new());
  const RequestConfig request(gpiod_request_config_new());
  if (!settings || !lines || !request) { return make_error(ErrorCode::Io, "GPIO: out of memory"); }
  const bool is_set = gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT) == 0 &&
                      gpiod_line_settings_set_edge_detection(settings.get(), GPIOD_LINE_EDGE_BOTH) == 0 &&
                      gpiod_line_settings_set_event_clock(settings.get(), GPIOD_LINE_CLOCK_MONOTONIC) == 0;
  gpiod_line_settings_set_debounce_period_us(settings.get(), static_cast<unsigned long>(config.debounce_us));
  gpiod_request_config_set_consumer(request.get(), "rosid");
  gpiod_request_config_set_event_buffer_size(request.get(), kKernelBuffer);
  if (!is_set || gpiod_line_config_add_line_settings(lines.get(), found.offsets.data(), found.offsets.size(),
                                                     settings.get()) != 0) {
    return make_error(ErrorCode::InvalidArgument, fmt::format("{}: {}", found.path, errno_text(errno)));
  }
  Request requested(gpiod_chip_request_lines(found.chip.get(), request.get(), lines.get()));
  if (!requested) {
    const int code = errno;
    if (code == EBUSY) { return tl::make_unexpected(busy_error(found, wanted_lines(config))); }
    if (code == EINVAL || code == ENOTSUP) {
      return make_error(ErrorCode::Unsupported,
                        fmt::format("{} gives no edges of these lines: {}", found.path, errno_text(code)));
    }
    return tl::make_unexpected(errno_error(code, found.path));
  }
  return requested;
}

class GpioLines final : public EdgeSource {
 public:
  GpioLines(Request request, Buffer buffer, Offsets offsets)
      : request_(std::move(request)), buffer_(std::move(buffer)), offsets_(std::move(offsets)) {}

  int fd() const override { return gpiod_line_request_get_fd(request_.get()); }

  Received read(std::span<EdgeRecord> edges) override {
    const int got = gpiod_line_request_read_edge_events(request_.get(), buffer_.get(), std::min(edges.size(), kBatch));
    if (got < 0) {
      const int code = errno;
      if (code == EAGAIN || code == EINTR) { return {}; }
      return {IoStatus::Closed, 0, code};
    }
    std::size_t count = 0;
    for (int k = 0; k < got; ++k) {
      gpiod_edge_event* event = gpiod_edge_event_buffer_get_event(buffer_.get(), static_cast<unsigned long>(k));
      const auto line = std::find(offsets_.begin(), offsets_.end(), gpiod_edge_event_get_line_offset(event));
      edges[count++] = {.t = time_from_ns(static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event))),
                        .sequence = static_cast<std::uint32_t>(gpiod_edge_event_get_global_seqno(event)),
                        .line_sequence = static_cast<std::uint32_t>(gpiod_edge_event_get_line_seqno(event)),
                        .line = static_cast<EdgeLine>(line - offsets_.begin()),
                        .is_rising = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE};
    }
    return {count > 0 ? IoStatus::Done : IoStatus::WouldBlock, count, 0};
  }

  int check() override {
    return gpiod_line_request_get_value(request_.get(), offsets_.front()) == GPIOD_LINE_VALUE_ERROR ? errno : 0;
  }

 private:
  Request request_;
  Buffer buffer_;
  Offsets offsets_;
};

}  // namespace

Result<std::unique_ptr<EdgeSource>> open_gpio_lines(const GpioConfig& config) {
  auto found = Search(config).run();
  if (!found) { return tl::make_unexpected(found.error()); }
  auto request = request_lines(*found, config);
  if (!request) { return tl::make_unexpected(request.error()); }
  // The kernel makes the descriptor; only this keeps a read from waiting.
  const int fd = gpiod_line_request_get_fd(request->get());
  const int flags = ::fcntl(fd, F_GETFL);
  Buffer buffer(gpiod_edge_event_buffer_new(kBatch));
  if (flags < 0 || ::fcntl(fd, F_SETFL, flags | O_NONBLOCK) != 0 || !buffer) {
    return make_error(ErrorCode::Io, fmt::format("{}: {}", found->path, errno_text(errno)));
  }
  return std::make_unique<GpioLines>(std::move(*request), std::move(buffer), std::move(found->offsets));
}

bool has_gpio_support() {
  return true;
}

}  // namespace rosid::hal
