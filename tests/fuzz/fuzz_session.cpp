// The whole laser session with bytes in both directions: the driver talks to a scripted device over a line, and the
// input says what goes wrong, when. Afterwards everything is in order again, and the stream must come back by itself.
// Input: pairs of bytes, what and how.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/front_end.hpp"
#include "hal/lms/protocol.hpp"
#include "tests/fuzz/fuzz_sink.hpp"
#include "tests/unit/hal/fake_lms.hpp"

namespace {

using namespace rosid;
using hal::test::FakeLms;

hal::HalConfig laser_only() {
  hal::HalConfig config;
  config.can.enabled = false;
  return config;
}

class Line final : public fuzz::CheckingSink {
 public:
  Line() : front_end_(laser_only(), {}, *this) {
    device_.script = [this](const FakeLms::Command& /*command*/) {
      const FakeLms::Reaction reaction = reaction_;
      reaction_ = FakeLms::Reaction::Obey;
      return reaction;
    };
    front_end_.on_laser_link(now_, true);
  }

  void write_laser(std::span<const std::uint8_t> bytes) override {
    fuzz::CheckingSink::write_laser(bytes);
    std::vector<std::uint8_t> sent(bytes.begin(), bytes.end());
    if (damage_ != 0) { sent[damage_ % sent.size()] ^= damage_; }
    damage_ = 0;
    device_.receive(now_, sent, baud_);
  }
  void set_laser_baud(int baud) override {
    fuzz::CheckingSink::set_laser_baud(baud);
    baud_ = baud;
  }

  void run(Duration time) {
    const Time end = now_ + time;
    while (now_ < end) {
      now_ += std::chrono::milliseconds(4);
      std::vector<std::uint8_t> bytes = device_.transmit(now_, baud_);
      for (std::size_t i = 0; noise_ != 0 && i < bytes.size(); i += noise_) { bytes[i] ^= noise_; }
      if (is_open_ && !bytes.empty()) { front_end_.on_laser_bytes(now_, bytes); }
      front_end_.tick(now_);
    }
  }

  /// Returns the bytes it took beyond the pair.
  std::size_t happen(unsigned what, std::uint8_t how, std::span<const std::uint8_t> rest) {
    constexpr std::array kBauds{9600, 19200, 38400, 500000};
    switch (what) {
      case 0: run(how * std::chrono::milliseconds(4)); break;
      case 1: reaction_ = static_cast<FakeLms::Reaction>(how % 6); break;
      case 2: {
        const auto bytes = rest.first(std::min<std::size_t>(how, rest.size()));
        if (is_open_ && !bytes.empty()) { front_end_.on_laser_bytes(now_, bytes); }
        return bytes.size();
      }
      case 3: damage_ = how; break;
      case 4: noise_ = how; break;
      case 5: device_.power_cycle(now_); break;
      case 6:
        is_open_ = (how & 1U) != 0;
        front_end_.on_laser_link(now_, is_open_);
        break;
      default:
        device_.is_on = (how & 1U) == 0;
        device_.baud = kBauds[(how >> 1U) & 3U];
        device_.is_streaming = (how & 8U) != 0;
        device_.status = static_cast<std::uint8_t>(hal::lms::status::kSourceLms | (how >> 5U));
        break;
    }
    return 0;
  }

  /// Everything in order: a pause, a round through the rates, a written configuration and a bring-up later it streams.
  void must_recover() {
    reaction_ = FakeLms::Reaction::Obey;
    damage_ = 0;
    noise_ = 0;
    device_.is_on = true;
    device_.status = hal::lms::status::kSourceLms;
    if (!is_open_) { front_end_.on_laser_link(now_, true); }
    is_open_ = true;
    const DeviceHealth& laser = front_end_.health()[static_cast<std::size_t>(Device::Laser)];
    for (int k = 0; k < 500 && laser.state != DeviceState::Running; ++k) { run(std::chrono::milliseconds(100)); }
    fuzz::require(laser.state == DeviceState::Running);
  }

 private:
  FakeLms device_;
  Time now_ = time_from_s(10.0);
  int baud_ = 0;
  bool is_open_ = true;
  std::uint8_t damage_ = 0;
  std::uint8_t noise_ = 0;
  FakeLms::Reaction reaction_ = FakeLms::Reaction::Obey;
  hal::FrontEnd front_end_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kMostEvents = 32;
  Line line;
  std::span<const std::uint8_t> rest(data, size);
  for (std::size_t k = 0; k < kMostEvents && rest.size() >= 2; ++k) {
    const unsigned what = rest[0] & 7U;
    const std::uint8_t how = rest[1];
    rest = rest.subspan(2);
    rest = rest.subspan(line.happen(what, how, rest));
  }
  line.must_recover();
  return 0;
}
