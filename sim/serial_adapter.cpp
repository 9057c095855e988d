#include "sim/serial_adapter.hpp"

namespace rosid::sim {

void SerialAdapter::pass(Time until, const std::vector<LineByte>& line, std::vector<std::uint8_t>& out) {
  if (timing_.latency == Duration{0}) {
    for (const LineByte& byte : line) { out.push_back(byte.value); }
    return;
  }
  for (const LineByte& byte : line) {
    while (t_flushed_ + timing_.latency <= byte.t) { flush(t_flushed_ + timing_.latency, out); }
    buffer_.push_back(byte.value);
    if (buffer_.size() >= timing_.packet_payload) { flush(byte.t, out); }
  }
  while (t_flushed_ + timing_.latency <= until) { flush(t_flushed_ + timing_.latency, out); }
}

void SerialAdapter::flush(Time t, std::vector<std::uint8_t>& out) {
  out.insert(out.end(), buffer_.begin(), buffer_.end());
  buffer_.clear();
  t_flushed_ = t;
}

}  // namespace rosid::sim
