#include "daemon/raw_record.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace rosid::daemon {

std::optional<msgs::LogRecord> RawAssembler::add(const RawRecord& raw) {
  using Laser = msgs::LaserRecord::Kind;
  using Can = msgs::CanRecord::Kind;
  const std::size_t length = std::min<std::size_t>(raw.length, raw.bytes.size());
  // What a full queue left of another read is no part of this one.
  if (raw.kind != kind_ || raw.t != t_) { bytes_.clear(); }
  kind_ = raw.kind;
  t_ = raw.t;
  bytes_.insert(bytes_.end(), raw.bytes.begin(), raw.bytes.begin() + static_cast<std::ptrdiff_t>(length));
  if (raw.continues) { return std::nullopt; }
  const auto laser = [&](Laser kind) {
    return msgs::LogRecord{raw.t, msgs::LaserRecord{kind, std::exchange(bytes_, {})}};
  };
  const auto can = [&](Can kind) {
    bytes_.clear();
    return msgs::LogRecord{raw.t, msgs::CanRecord{kind, raw.frame}};
  };
  const auto gpio = [&](msgs::GpioRecord::Kind kind) {
    msgs::GpioRecord record{kind, std::vector<hal::EdgeRecord>(bytes_.size() / sizeof(hal::EdgeRecord))};
    if (!record.edges.empty()) {
      std::memcpy(static_cast<void*>(record.edges.data()), bytes_.data(),
                  record.edges.size() * sizeof(hal::EdgeRecord));
    }
    bytes_.clear();
    return msgs::LogRecord{raw.t, std::move(record)};
  };
  switch (raw.kind) {
    case RawRecord::Kind::LaserReceived: return laser(Laser::Received);
    case RawRecord::Kind::LaserSent: return laser(Laser::Sent);
    case RawRecord::Kind::LaserUp: return laser(Laser::LinkUp);
    case RawRecord::Kind::LaserDown: return laser(Laser::LinkDown);
    case RawRecord::Kind::HostBaud: return laser(Laser::HostBaud);
    case RawRecord::Kind::CanReceived: return can(Can::Received);
    case RawRecord::Kind::CanSent: return can(Can::Sent);
    case RawRecord::Kind::CanUp: return can(Can::LinkUp);
    case RawRecord::Kind::CanDown: return can(Can::LinkDown);
    case RawRecord::Kind::EdgesReceived: return gpio(msgs::GpioRecord::Kind::Received);
    case RawRecord::Kind::TurretUp: return gpio(msgs::GpioRecord::Kind::LinkUp);
    case RawRecord::Kind::TurretDown: return gpio(msgs::GpioRecord::Kind::LinkDown);
  }
  return std::nullopt;
}

}  // namespace rosid::daemon
