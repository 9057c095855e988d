#pragma once
// The laser as one pure object: parser, session, decoder and mirror clock wired together. Bytes in, scan lines, bytes
// and baud changes out. No allocation. One thread.

#include <cstdint>
#include <span>

#include "base/calibration.hpp"
#include "base/health.hpp"
#include "base/samples.hpp"
#include "hal/config.hpp"
#include "hal/front_end.hpp"
#include "hal/lms/mirror_clock.hpp"
#include "hal/lms/scan_decoder.hpp"
#include "hal/lms/scan_watch.hpp"
#include "hal/lms/session.hpp"
#include "hal/lms/telegram.hpp"

namespace rosid::hal::lms {

/// Time-outs act at their own instant, however late tick() comes (unless by more than 100 ms, when the process was
/// stopped): the outcome depends on bytes and stamps alone, so that a replay takes the same way as the live run.
class Laser final : private ParserSink, private SessionActions {
 public:
  Laser(const LaserConfig& config, const Calibration& calibration, FrontEndSink& sink, DeviceHealth& health);

  void on_bytes(Time t_receive, std::span<const std::uint8_t> bytes);
  void on_link(Time now, bool is_open);
  void tick(Time now);
  /// Wheels or turret moved.
  void on_motion(Time t) { watch_.on_motion(t); }

  const Session& session() const { return session_; }
  const Parser& parser() const { return parser_; }
  const MirrorClock& clock() const { return clock_; }
  const ScanWatch& watch() const { return watch_; }
  /// What it is doing or what is wrong, for a person. Static storage.
  const char* detail() const;

 private:
  void on_telegram(const Telegram& telegram) override;
  void on_ack(Time t) override;
  void on_nak(Time t) override;
  void on_damaged(std::span<const std::uint8_t> payload) override;
  void write(std::span<const std::uint8_t> bytes) override;
  void set_baud(int baud) override;

  void advance_to(Time now);
  void on_measured(const Telegram& telegram);
  bool stamp_line(const Telegram& telegram, const Measured& measured);
  void publish_health();

  LaserConfig config_;
  Duration latency_;
  FrontEndSink& sink_;
  DeviceHealth& health_;
  Parser parser_{ParserRole::Host};
  Session session_;
  MirrorClock clock_;
  ScanWatch watch_;
  ScanLine line_;
  Time now_;  // of the call that is being handled
};

}  // namespace rosid::hal::lms
