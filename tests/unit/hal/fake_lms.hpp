#pragma once
// A scripted LMS for tests of the driver, in virtual time: answers commands, changes its baud rate, streams, and
// misbehaves on request. Bytes leave one after the other at the line's speed.

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "hal/lms/telegram.hpp"

namespace rosid::hal::test {

class FakeLms final : private lms::ParserSink {
 public:
  struct Command {
    int number = 0;  ///< counts from 1
    std::uint8_t code = 0;
    std::vector<std::uint8_t> data;
  };
  enum class Reaction : std::uint8_t {
    Obey,
    Nak,
    Ignore,
    Refuse,
    NotUnderstood,
    Mute,  ///< obeys, but acknowledge and answer are lost
  };

  // What the test may preset or change at any time.
  int baud = 9600;
  bool is_on = true;
  bool is_streaming = false;
  std::uint8_t stream_mode = lms::mode::kStreamPartial;
  std::vector<std::uint8_t> config = std::vector<std::uint8_t>(34, 0);
  int opening_deg = 180;
  int resolution_cdeg = 50;
  std::uint8_t address = 0;
  std::uint8_t status = lms::status::kSourceLms;
  double mirror_period_s = 1.0 / 75.0;
  int send_every = 1;      // of the scans measured; the others are lost on the way
  bool is_frozen = false;  // sends the last ranges again
  int blind_word = -1;     // what every beam says; -1: ranges
  std::function<Reaction(const Command&)> script = [](const Command&) { return Reaction::Obey; };

  // What the test may look at.
  std::vector<Command> commands;
  int config_writes = 0;
  int turns_sent = 0;
  int wobble = 0;  // noise of the last beam, so that no two scans are equal

  FakeLms() { config[lms::config_offset::kUnit] = 1; }

  /// Bytes of the host; at another baud rate the device sees nothing it understands.
  void receive(Time now, std::span<const std::uint8_t> bytes, int host_baud) {
    now_ = now;
    if (!is_on || host_baud != baud) { return; }
    parser_.feed(now, bytes, *this);
  }

  void power_cycle(Time now) {
    baud = 9600;
    is_streaming = false;
    out_.clear();
    parser_.reset();
    now_ = now;
    lms::TelegramBuilder builder = lms::reply(address, lms::command::kPowerOn);
    const std::string_view name = "LMS200;301061;V02.30 ";
    for (const char c : name) { builder.u8(static_cast<std::uint8_t>(c)); }
    builder.u8(status);
    send(builder);
  }

  /// Advances to `now` and hands over the bytes that have left until then, as the host's UART at host_baud sees them.
  std::vector<std::uint8_t> transmit(Time now, int host_baud) {
    now_ = now;
    stream_until(now);
    std::vector<std::uint8_t> bytes;
    while (!out_.empty() && out_.front().t_end <= now) {
      const Out& out = out_.front();
      const bool is_same = out.baud == host_baud;
      bytes.push_back(is_same ? out.byte : static_cast<std::uint8_t>(out.byte * 7U + 0x35U));
      out_.pop_front();
    }
    return bytes;
  }

  /// Bytes it says at this moment without having been asked.
  void inject(std::span<const std::uint8_t> bytes) { send_bytes(bytes, now_); }

  /// End of the 180 degree sweep of mirror turn k.
  Time sweep_end(std::int64_t turn) const { return time_from_s(0.5 + static_cast<double>(turn) * mirror_period_s); }

  /// Turns whose telegrams were sent, in order.
  const std::vector<std::int64_t>& sent_turns() const { return sent_turns_; }

 private:
  struct Out {
    Time t_end;
    std::uint8_t byte;
    int baud;
  };

  Duration byte_time() const { return duration_from_s(10.0 / baud); }

  void send_bytes(std::span<const std::uint8_t> bytes, Time t_start) {
    if (!is_on || is_mute_) { return; }
    if (!out_.empty()) { t_start = std::max(t_start, out_.back().t_end); }
    for (const std::uint8_t byte : bytes) {
      t_start += byte_time();
      out_.push_back({t_start, byte, baud});
    }
  }
  void send(lms::TelegramBuilder& builder) { send_bytes(builder.finish(), now_); }
  void send_byte(std::uint8_t byte) { send_bytes({&byte, 1}, now_); }

  void reply_code(std::uint8_t code, std::uint8_t value) {
    lms::TelegramBuilder builder = lms::reply(address, code);
    builder.u8(value).u8(status);
    send(builder);
  }

  void on_ack(Time) override {}
  void on_nak(Time) override {}
  void on_telegram(const lms::Telegram& telegram) override {
    const auto data = telegram.request_data();
    Command command{static_cast<int>(commands.size()) + 1, telegram.command(), {data.begin(), data.end()}};
    commands.push_back(command);
    const Reaction reaction = script(command);
    if (reaction == Reaction::Ignore) { return; }
    if (reaction == Reaction::Nak) {
      send_byte(lms::kNak);
      return;
    }
    if (reaction == Reaction::Mute) {
      is_mute_ = true;
      obey(command, false);
      is_mute_ = false;
      return;
    }
    send_byte(lms::kAck);
    if (reaction == Reaction::NotUnderstood) {
      lms::TelegramBuilder builder = lms::reply(address, lms::command::kNotUnderstood);
      builder.u8(status);
      send(builder);
      return;
    }
    obey(command, reaction == Reaction::Refuse);
  }

  void obey(const Command& command, bool is_refused) {
    namespace cmd = lms::command;
    switch (command.code) {
      case cmd::kSetMode: set_mode(command, is_refused); break;
      case cmd::kStatus: send_status(); break;
      case cmd::kReadConfig: {
        lms::TelegramBuilder builder = lms::reply(address, cmd::kReadConfigReply);
        builder.bytes(config).u8(status);
        send(builder);
        break;
      }
      case cmd::kWriteConfig: {
        ++config_writes;
        if (!is_refused) { config = command.data; }
        lms::TelegramBuilder builder = lms::reply(address, cmd::kWriteConfigReply);
        builder.u8(is_refused ? 0 : 1).bytes(config).u8(status);
        send(builder);
        break;
      }
      case cmd::kVariant: {
        if (!is_refused) {
          opening_deg = command.data[0];
          resolution_cdeg = command.data[2];
        }
        lms::TelegramBuilder builder = lms::reply(address, cmd::kVariantReply);
        builder.u8(is_refused ? 0 : 1).u16(static_cast<std::uint16_t>(opening_deg));
        builder.u16(static_cast<std::uint16_t>(resolution_cdeg)).u8(status);
        send(builder);
        break;
      }
      default: break;
    }
  }

  void set_mode(const Command& command, bool is_refused) {
    const std::uint8_t mode = command.data.at(0);
    reply_code(lms::command::kModeReply, is_refused ? 1 : 0);
    if (is_refused) { return; }
    if (const int new_baud = lms::mode_baud(mode); new_baud != 0) {
      baud = new_baud;
    } else if (mode == lms::mode::kStreamComplete || mode == lms::mode::kStreamPartial) {
      stream_mode = mode;
      is_streaming = true;
      next_turn_ = first_turn_after(now_);
    } else {
      is_streaming = false;
    }
  }

  void send_status() {
    lms::TelegramBuilder builder = lms::reply(address, lms::command::kStatusReply);
    std::vector<std::uint8_t> data(lms::kStatusLength - 2, 0);
    data[lms::status_offset::kMeasuringMode - 1] = config[lms::config_offset::kMeasuringMode];
    builder.bytes(data).u8(status);
    send(builder);
  }

  std::int64_t first_turn_after(Time t) const {
    std::int64_t turn = 0;
    while (sweep_end(turn) <= t) { ++turn; }
    return turn;
  }

  void stream_until(Time now) {
    if (!is_streaming) { return; }
    if (next_turn_ < 0) { next_turn_ = first_turn_after(now); }
    for (; sweep_end(next_turn_) <= now; ++next_turn_) {
      const int turns_per_scan = stream_mode == lms::mode::kStreamPartial ? 1 : 100 / resolution_cdeg;
      const bool is_busy = !out_.empty() && out_.back().t_end > sweep_end(next_turn_);
      if (is_busy || next_turn_ % turns_per_scan != turns_per_scan - 1) { continue; }
      send_scan(next_turn_);
    }
  }

  void send_scan(std::int64_t turn) {
    const bool is_partial = stream_mode == lms::mode::kStreamPartial;
    const int phases = 100 / resolution_cdeg;
    lms::MeasuredHeader header{.is_partial = is_partial, .unit = config[lms::config_offset::kUnit]};
    if (is_partial) {
      header.raster = static_cast<std::uint8_t>((turn % phases) * (4 / phases));
      header.count = header.raster == 0 ? 181 : 180;
    } else {
      header.count = static_cast<std::uint16_t>(opening_deg * 100 / resolution_cdeg + 1);
    }
    lms::TelegramBuilder builder = lms::reply(address, lms::command::kMeasured);
    builder.u16(lms::pack_header(header));
    if (!is_frozen) { wobble = (wobble + 1) % 7; }
    for (int i = 0; i < header.count; ++i) {
      const int range = i + 1 == header.count ? 1500 + wobble : 1000 + i;
      builder.u16(static_cast<std::uint16_t>(blind_word < 0 ? range : blind_word));
    }
    if ((config[lms::config_offset::kAvailability] & lms::kAvailabilityIndices) != 0) {
      builder.u8(static_cast<std::uint8_t>(turn & 0xFF)).u8(static_cast<std::uint8_t>(turns_sent & 0xFF));
    }
    builder.u8(status);
    ++turns_sent;
    if (turns_sent % send_every != 0) { return; }
    sent_turns_.push_back(turn);
    send_bytes(builder.finish(), sweep_end(turn));
  }

  lms::Parser parser_{lms::ParserRole::Device};
  Time now_;
  std::deque<Out> out_;
  bool is_mute_ = false;
  std::int64_t next_turn_ = -1;
  std::vector<std::int64_t> sent_turns_;
};

}  // namespace rosid::hal::test
