#include "sim/slcan_adapter.hpp"

namespace rosid::sim {
namespace {

constexpr std::uint8_t kOk = '\r';
constexpr std::uint8_t kError = '\a';

void append(std::vector<std::uint8_t>& bytes, std::string_view text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
}

}  // namespace

/// The parser's sink while one piece of host text is worked on.
class SlcanAdapter::Session final : public hal::SlcanSink {
 public:
  Session(SlcanAdapter& adapter, std::vector<hal::CanFrame>& to_bus, std::vector<std::uint8_t>& to_host)
      : adapter_(adapter), to_bus_(to_bus), to_host_(to_host) {}

  void on_slcan_frame(const hal::CanFrame& frame) override {
    if (!adapter_.is_open_ || adapter_.is_listening_only_) {
      to_host_.push_back(kError);
      return;
    }
    if (adapter_.reaches_bus()) { to_bus_.push_back(frame); }
    append(to_host_, frame.is_extended ? "Z\r" : "z\r");
  }
  void on_slcan_line(std::string_view line) override {
    if (!adapter_.run_command(line, to_host_)) { to_host_.push_back(kError); }
  }
  void on_slcan_error() override {}

 private:
  SlcanAdapter& adapter_;
  std::vector<hal::CanFrame>& to_bus_;
  std::vector<std::uint8_t>& to_host_;
};

void SlcanAdapter::from_host(std::span<const std::uint8_t> bytes, std::vector<hal::CanFrame>& to_bus,
                             std::vector<std::uint8_t>& to_host) {
  Session session(*this, to_bus, to_host);
  const std::uint64_t errors_before = parser_.format_errors();
  parser_.feed(bytes, session);
  for (std::uint64_t k = errors_before; k < parser_.format_errors(); ++k) { to_host.push_back(kError); }
}

void SlcanAdapter::from_bus(const hal::CanFrame& frame, std::vector<std::uint8_t>& to_host) const {
  if (!reaches_bus()) { return; }
  const hal::SlcanText text = hal::encode_slcan(frame);
  to_host.insert(to_host.end(), text.view().begin(), text.view().end());
}

bool SlcanAdapter::run_command(std::string_view line, std::vector<std::uint8_t>& to_host) {
  if (line.empty()) {
    to_host.push_back(kOk);
    return true;
  }
  const std::string_view argument = line.substr(1);
  switch (line.front()) {
    case 'S': {
      const auto bitrate = argument.size() == 1 ? hal::slcan_code_bitrate(argument.front()) : std::nullopt;
      if (is_open_ || !bitrate) { return false; }
      bitrate_ = *bitrate;
      break;
    }
    case 'O':
    case 'L':
      if (is_open_) { return false; }
      is_open_ = true;
      is_listening_only_ = line.front() == 'L';
      break;
    case 'C':
      if (!is_open_) { return false; }
      is_open_ = false;
      break;
    case 'V': append(to_host, "V1013"); break;
    case 'N': append(to_host, "NSIM1"); break;
    case 'F': append(to_host, "F00"); break;
    case 'Z':
      if (argument != "0") { return false; }  // no time stamps
      break;
    default: return false;
  }
  to_host.push_back(kOk);
  return true;
}

}  // namespace rosid::sim
