#include "msgs/log_codec.hpp"

#include <algorithm>
#include <limits>
#include <rosid/raw_can_t.hpp>
#include <rosid/raw_config_t.hpp>
#include <rosid/raw_fix_t.hpp>
#include <rosid/raw_gpio_t.hpp>
#include <rosid/raw_laser_t.hpp>

#include "msgs/bytes.hpp"

namespace rosid::msgs {

namespace {

template <typename Message>
void put_header(LcmWriter& out, Time t) {
  out.put(Message::getHash());
  out.put(to_ns(t));
}

/// False: the payload is of another type.
template <typename Message>
bool get_header(LcmReader& in, Time& t) {
  const bool is_type = in.get<std::int64_t>() == Message::getHash();
  t = time_from_ns(in.get<std::int64_t>());
  return is_type && !in.failed();
}

struct Encoder {
  LcmWriter out;
  Time t;

  void operator()(const ConfigRecord& record) {
    put_header<raw_config_t>(out, t);
    out.put(static_cast<std::int32_t>(record.toml.size() + 1));
    for (const char c : record.toml) { out.put(static_cast<std::uint8_t>(c)); }
    out.put(std::uint8_t{0});
  }

  void operator()(const LaserRecord& record) {
    put_header<raw_laser_t>(out, t);
    out.put(static_cast<std::int8_t>(record.kind));
    out.put(static_cast<std::int32_t>(record.bytes.size()));
    out.put_bytes(record.bytes);
  }

  void operator()(const CanRecord& record) {
    const hal::CanFrame& frame = record.frame;
    put_header<raw_can_t>(out, t);
    out.put(static_cast<std::int8_t>(record.kind));
    const int flags = (frame.is_extended ? raw_can_t::EXTENDED : 0) | (frame.is_remote ? raw_can_t::REMOTE : 0) |
                      (frame.is_error ? raw_can_t::ERROR : 0);
    out.put(static_cast<std::int8_t>(flags));
    out.put(static_cast<std::int8_t>(frame.length));
    out.put(static_cast<std::int32_t>(frame.id));
    out.put_bytes(frame.data);
  }

  void operator()(const GpioRecord& record) {
    put_header<raw_gpio_t>(out, t);
    out.put(static_cast<std::int8_t>(record.kind));
    out.put(static_cast<std::int32_t>(record.edges.size()));
    for (const hal::EdgeRecord& edge : record.edges) { out.put(to_ns(edge.t)); }
    for (const hal::EdgeRecord& edge : record.edges) { out.put(static_cast<std::int32_t>(edge.sequence)); }
    for (const hal::EdgeRecord& edge : record.edges) { out.put(static_cast<std::int32_t>(edge.line_sequence)); }
    for (const hal::EdgeRecord& edge : record.edges) { out.put(static_cast<std::int8_t>(edge.line)); }
    for (const hal::EdgeRecord& edge : record.edges) { out.put(static_cast<std::int8_t>(edge.is_rising ? 1 : 0)); }
  }

  void operator()(const FixRecord& record) {
    const SurfaceFix& fix = record.fix;
    put_header<raw_fix_t>(out, t);
    out.put(std::int64_t{0});
    out.put(to_ns(fix.t_view));
    out.put(static_cast<std::int32_t>(fix.view_id));
    out.put(static_cast<std::int32_t>(fix.pair_count));
    out.put(static_cast<std::int32_t>(fix.null_count));
    out.put(fix.chi2);
    out.put(fix.chi2_dof);
    out.put(fix.confidence);
    out.put_all<double>(fix.X_WV.p_m);
    out.put_all<double>(fix.X_WV.q_wxyz);
    out.put_all<double>(fix.information);
    out.put_all<double>(fix.covariance_correlated);
    out.put_all<double>(fix.null_directions);
  }
};

using Body = decltype(LogRecord::body);

std::optional<Body> decode_config(LcmReader& in, Time& t) {
  if (!get_header<raw_config_t>(in, t)) { return std::nullopt; }
  const auto length = in.get<std::int32_t>();
  // LCM strings end in a zero that counts.
  if (length < 1 || static_cast<std::size_t>(length) != in.remaining()) { return std::nullopt; }
  const auto text = in.get_bytes(static_cast<std::size_t>(length));
  if (text.empty() || text.back() != 0) { return std::nullopt; }
  ConfigRecord record;
  record.toml.assign(text.begin(), text.end() - 1);
  return record;
}

std::optional<Body> decode_laser(LcmReader& in, Time& t) {
  if (!get_header<raw_laser_t>(in, t)) { return std::nullopt; }
  const auto kind = in.get<std::int8_t>();
  const auto length = in.get<std::int32_t>();
  if (kind < 0 || kind > raw_laser_t::HOST_BAUD || length < 0 || static_cast<std::size_t>(length) != in.remaining()) {
    return std::nullopt;
  }
  const auto bytes = in.get_bytes(static_cast<std::size_t>(length));
  LaserRecord record;
  record.kind = static_cast<LaserRecord::Kind>(kind);
  record.bytes.assign(bytes.begin(), bytes.end());
  return record;
}

std::optional<Body> decode_can(LcmReader& in, Time& t) {
  if (!get_header<raw_can_t>(in, t)) { return std::nullopt; }
  const auto kind = in.get<std::int8_t>();
  const unsigned flags = static_cast<std::uint8_t>(in.get<std::int8_t>());
  const auto length = in.get<std::int8_t>();
  if (kind < 0 || kind > raw_can_t::LINK_DOWN || length < 0 || length > 8) { return std::nullopt; }
  CanRecord record;
  record.kind = static_cast<CanRecord::Kind>(kind);
  record.frame.is_extended = (flags & static_cast<unsigned>(raw_can_t::EXTENDED)) != 0;
  record.frame.is_remote = (flags & static_cast<unsigned>(raw_can_t::REMOTE)) != 0;
  record.frame.is_error = (flags & static_cast<unsigned>(raw_can_t::ERROR)) != 0;
  record.frame.length = static_cast<std::uint8_t>(length);
  record.frame.id = static_cast<std::uint32_t>(in.get<std::int32_t>());
  in.get_all<std::uint8_t>(record.frame.data);
  return record;
}

std::optional<Body> decode_gpio(LcmReader& in, Time& t) {
  constexpr std::size_t kEdgeBytes = 18;
  if (!get_header<raw_gpio_t>(in, t)) { return std::nullopt; }
  const auto kind = in.get<std::int8_t>();
  const auto count = in.get<std::int32_t>();
  const bool is_kind = kind == raw_gpio_t::RECEIVED || kind == raw_gpio_t::LINK_UP || kind == raw_gpio_t::LINK_DOWN;
  if (!is_kind || count < 0 || kEdgeBytes * static_cast<std::size_t>(count) != in.remaining()) { return std::nullopt; }
  GpioRecord record;
  record.kind = static_cast<GpioRecord::Kind>(kind);
  record.edges.resize(static_cast<std::size_t>(count));
  for (hal::EdgeRecord& edge : record.edges) { edge.t = time_from_ns(in.get<std::int64_t>()); }
  for (hal::EdgeRecord& edge : record.edges) { edge.sequence = static_cast<std::uint32_t>(in.get<std::int32_t>()); }
  for (hal::EdgeRecord& edge : record.edges) {
    edge.line_sequence = static_cast<std::uint32_t>(in.get<std::int32_t>());
  }
  for (hal::EdgeRecord& edge : record.edges) { edge.line = static_cast<hal::EdgeLine>(in.get<std::int8_t>()); }
  for (hal::EdgeRecord& edge : record.edges) { edge.is_rising = in.get<std::int8_t>() != 0; }
  return record;
}

std::optional<Body> decode_fix(LcmReader& in, Time& t) {
  if (!get_header<raw_fix_t>(in, t)) { return std::nullopt; }
  FixRecord record;
  SurfaceFix& fix = record.fix;
  static_cast<void>(in.get<std::int64_t>());
  fix.t_view = time_from_ns(in.get<std::int64_t>());
  const auto view_id = in.get<std::int32_t>();
  const auto pair_count = in.get<std::int32_t>();
  const auto null_count = in.get<std::int32_t>();
  if (pair_count < 0 || pair_count > std::numeric_limits<std::uint16_t>::max() || null_count < 0 || null_count > 6) {
    return std::nullopt;
  }
  fix.view_id = static_cast<std::uint32_t>(view_id);
  fix.pair_count = static_cast<std::uint16_t>(pair_count);
  fix.null_count = static_cast<std::uint8_t>(null_count);
  fix.chi2 = in.get<double>();
  fix.chi2_dof = in.get<double>();
  fix.confidence = in.get<double>();
  in.get_all<double>(fix.X_WV.p_m);
  in.get_all<double>(fix.X_WV.q_wxyz);
  in.get_all<double>(fix.information);
  in.get_all<double>(fix.covariance_correlated);
  in.get_all<double>(fix.null_directions);
  return record;
}

}  // namespace

std::string_view channel_of(const LogRecord& record) {
  struct Visitor {
    std::string_view operator()(const ConfigRecord& /*record*/) const { return kChannelConfig; }
    std::string_view operator()(const LaserRecord& /*record*/) const { return kChannelLaser; }
    std::string_view operator()(const CanRecord& /*record*/) const { return kChannelCan; }
    std::string_view operator()(const GpioRecord& /*record*/) const { return kChannelGpio; }
    std::string_view operator()(const FixRecord& /*record*/) const { return kChannelFix; }
  };
  return std::visit(Visitor{}, record.body);
}

bool is_log_channel(std::string_view channel) {
  return channel == kChannelConfig || channel == kChannelLaser || channel == kChannelCan || channel == kChannelGpio ||
         channel == kChannelFix;
}

void encode_payload(const LogRecord& record, std::vector<std::uint8_t>& out) {
  std::visit(Encoder{LcmWriter(out), record.t}, record.body);
}

std::optional<LogRecord> decode_payload(std::string_view channel, std::span<const std::uint8_t> payload) {
  LcmReader in(payload);
  Time t;
  std::optional<Body> body;
  if (channel == kChannelLaser) {
    body = decode_laser(in, t);
  } else if (channel == kChannelCan) {
    body = decode_can(in, t);
  } else if (channel == kChannelGpio) {
    body = decode_gpio(in, t);
  } else if (channel == kChannelFix) {
    body = decode_fix(in, t);
  } else if (channel == kChannelConfig) {
    body = decode_config(in, t);
  }
  if (!body.has_value() || !in.is_complete()) { return std::nullopt; }
  return LogRecord{t, std::move(*body)};
}

}  // namespace rosid::msgs
