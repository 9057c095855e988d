#include "sim/canopen_node.hpp"

#include <algorithm>
#include <span>

namespace rosid::sim {
namespace {

constexpr std::uint32_t kPdoOff = 0x80000000U;

// SDO abort codes (devices 3.1 and CiA 301).
constexpr std::uint32_t kUnknownCommand = 0x05040001U;
constexpr std::uint32_t kReadOnly = 0x06010002U;
constexpr std::uint32_t kNoObject = 0x06020000U;
constexpr std::uint32_t kWrongLength = 0x06070010U;
constexpr std::uint32_t kNoSubIndex = 0x06090011U;
constexpr std::uint32_t kBadValue = 0x06090030U;
constexpr std::uint32_t kWrongState = 0x08000022U;

hal::CanFrame sdo_answer(std::uint8_t command, std::uint32_t object_key, std::uint32_t value) {
  hal::CanFrame frame;
  frame.length = 8;
  frame.data = {command, static_cast<std::uint8_t>((object_key >> 8U) & 0xFFU),
                static_cast<std::uint8_t>((object_key >> 16U) & 0xFFU), static_cast<std::uint8_t>(object_key & 0xFFU)};
  for (unsigned k = 0; k < 4; ++k) { frame.data.at(4 + k) = static_cast<std::uint8_t>((value >> (8U * k)) & 0xFFU); }
  return frame;
}

std::uint32_t little_endian(std::span<const std::uint8_t> bytes) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < bytes.size(); ++k) { value |= std::uint32_t{bytes[k]} << (8U * k); }
  return value;
}

}  // namespace

CanopenNode::CanopenNode(const CanopenOptions& options, Time t_power_on) : options_(options), t_boot_(t_power_on) {}

bool CanopenNode::accept(unsigned /*index*/, unsigned /*sub*/, std::uint32_t /*value*/) {
  return true;
}

void CanopenNode::define_communication() {
  const auto id = static_cast<unsigned>(options_.node_id);
  define(0x1001, 0, {.value = 0, .size = 1});
  define(0x1003, 0, {.value = 0, .size = 1, .is_writable = true});
  define(0x1005, 0, {.value = 0x80});
  define(0x1014, 0, {.value = 0x80 + id});
  define(0x1017, 0, {.value = 0, .size = 2, .is_writable = true});
  define(0x1018, 0, {.value = 4, .size = 1});
  define(0x1018, 1, {.value = 0x0000FFFF});  // no vendor has this number
  define(0x1018, 2, {.value = 1});
  define(0x1018, 3, {.value = 0x00010000});
  define(0x1018, 4, {.value = 1000 + id});
  define(0x1800, 0, {.value = 5, .size = 1});
  define(0x1800, 1, {.value = 0x180 + id, .is_writable = true});
  define(0x1800, 2, {.value = options_.tpdo_type, .size = 1, .is_writable = true});
  define(0x1800, 3, {.value = 0, .size = 2, .is_writable = true});
  define(0x1800, 5, {.value = static_cast<std::uint32_t>(options_.tpdo_period_ms), .size = 2, .is_writable = true});
}

void CanopenNode::boot(Time t) {
  state_ = NmtState::Off;
  t_tpdo_.reset();
  t_heartbeat_.reset();
  objects_.clear();
  define_communication();
  define_profile();
  t_boot_ = t + options_.boot_time;
}

void CanopenNode::reset(Time t) {
  boot(t);
}

Time CanopenNode::next_activity() const {
  if (state_ == NmtState::Off) { return t_boot_; }
  return std::min(t_tpdo_.value_or(Time::max()), t_heartbeat_.value_or(Time::max()));
}

Time CanopenNode::next_due() const {
  Time due = next_activity();
  for (const TimedFrame& frame : outbox_) { due = std::min(due, frame.t); }
  return due;
}

void CanopenNode::advance(Time until, std::vector<TimedFrame>& out) {
  for (Time t = next_activity(); t <= until; t = next_activity()) {
    if (state_ == NmtState::Off) {
      const std::array<std::uint8_t, 1> boot_up{0};
      send(t, 0x700U + static_cast<unsigned>(options_.node_id), boot_up);
      enter(t, options_.starts_itself ? NmtState::Operational : NmtState::PreOperational);
    } else if (t_tpdo_ && *t_tpdo_ <= t) {
      send_tpdo(t);
      schedule_tpdo(t, std::chrono::milliseconds(value(0x1800, 5)));
    } else {
      send_heartbeat(t);
      schedule_heartbeat(t);
    }
  }
  const auto later = std::stable_partition(outbox_.begin(), outbox_.end(),
                                           [until](const TimedFrame& frame) { return frame.t <= until; });
  std::stable_sort(outbox_.begin(), later, [](const TimedFrame& a, const TimedFrame& b) { return a.t < b.t; });
  out.insert(out.end(), outbox_.begin(), later);
  outbox_.erase(outbox_.begin(), later);
}

void CanopenNode::enter(Time t, NmtState state) {
  state_ = state;
  t_tpdo_.reset();
  if (state == NmtState::Operational) { schedule_tpdo(t, options_.tpdo_phase); }
  schedule_heartbeat(t);
}

bool CanopenNode::is_timer_driven() const {
  return value(0x1800, 2) >= 0xFE && value(0x1800, 5) != 0 && (value(0x1800, 1) & kPdoOff) == 0;
}

void CanopenNode::schedule_tpdo(Time t, Duration delay) {
  t_tpdo_.reset();
  if (state_ == NmtState::Operational && is_timer_driven()) { t_tpdo_ = t + delay; }
}

void CanopenNode::schedule_heartbeat(Time t) {
  t_heartbeat_.reset();
  const std::uint32_t period_ms = value(0x1017, 0);
  if (state_ != NmtState::Off && period_ms != 0) { t_heartbeat_ = t + std::chrono::milliseconds(period_ms); }
}

void CanopenNode::send(Time t, unsigned id, std::span<const std::uint8_t> data) {
  hal::CanFrame frame;
  frame.id = id;
  frame.length = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data.begin());
  outbox_.push_back({.t = t, .frame = frame});
}

void CanopenNode::send_heartbeat(Time t) {
  const std::array<std::uint8_t, 1> data{static_cast<std::uint8_t>(state_)};
  send(t, 0x700U + static_cast<unsigned>(options_.node_id), data);
}

void CanopenNode::send_tpdo(Time t) {
  measure(t);
  std::vector<std::uint8_t> data;
  const std::uint32_t count = value(0x1A00, 0);
  for (unsigned k = 1; k <= count; ++k) {
    const std::uint32_t mapped = value(0x1A00, k);
    const auto found = objects_.find(mapped >> 8U);
    const std::uint32_t content = found == objects_.end() ? 0 : found->second.value;
    for (unsigned bit = 0; bit < (mapped & 0xFFU) && data.size() < 8; bit += 8) {
      data.push_back(static_cast<std::uint8_t>((content >> bit) & 0xFFU));
    }
  }
  send(t, value(0x1800, 1) & 0x7FFU, data);
}

void CanopenNode::raise_emergency(Time t, std::uint16_t code, std::uint8_t error_register,
                                  const std::array<std::uint8_t, 5>& vendor) {
  if (state_ == NmtState::Off) { return; }
  set_value(0x1001, 0, error_register);
  std::array<std::uint8_t, 8> data{static_cast<std::uint8_t>(code & 0xFFU), static_cast<std::uint8_t>(code >> 8U),
                                   error_register};
  std::copy(vendor.begin(), vendor.end(), data.begin() + 3);
  send(t, value(0x1014, 0) & 0x7FFU, data);
}

void CanopenNode::receive(Time t, const hal::CanFrame& frame) {
  if (state_ == NmtState::Off || frame.is_extended || frame.is_remote || frame.is_error) { return; }
  if (frame.id == 0x000 && frame.length >= 2) {
    on_nmt(t, frame);
  } else if (frame.id == 0x080 && state_ == NmtState::Operational) {
    const std::uint32_t type = value(0x1800, 2);
    if (type == 0 || type > 240 || (value(0x1800, 1) & kPdoOff) != 0 || ++syncs_ % type != 0) { return; }
    send_tpdo(t);
  } else if (frame.id == 0x600U + static_cast<unsigned>(options_.node_id) && state_ != NmtState::Stopped) {
    on_sdo(t, frame);
  }
}

void CanopenNode::on_nmt(Time t, const hal::CanFrame& frame) {
  const unsigned node = frame.data[1];
  if (node != 0 && node != static_cast<unsigned>(options_.node_id)) { return; }
  switch (frame.data[0]) {
    case 0x01: enter(t, NmtState::Operational); break;
    case 0x02: enter(t, NmtState::Stopped); break;
    case 0x80: enter(t, NmtState::PreOperational); break;
    case 0x81:
    case 0x82: boot(t); break;
    default: break;
  }
}

void CanopenNode::on_sdo(Time t, const hal::CanFrame& request) {
  if (request.length != 8) { return; }
  const unsigned index = request.data[1] + (unsigned{request.data[2]} << 8U);
  const std::uint32_t object_key = key(index, request.data[3]);
  const unsigned command = request.data[0];
  hal::CanFrame answer;
  measure(t);
  if (command == 0x40U) {
    answer = upload(object_key);
  } else if ((command & 0xE2U) == 0x22U) {  // expedited download, with or without a size
    answer = download(request, object_key);
    schedule_heartbeat(t);
    if (state_ == NmtState::Operational && (index == 0x1800 || index == 0x6200)) {
      schedule_tpdo(t, std::chrono::milliseconds(value(0x1800, 5)));
    }
  } else {
    answer = sdo_answer(0x80, object_key, kUnknownCommand);
  }
  send(t + options_.sdo_time, 0x580U + static_cast<unsigned>(options_.node_id),
       std::span<const std::uint8_t>(answer.data));
}

bool CanopenNode::has_index(std::uint32_t object_key) const {
  const auto first = objects_.lower_bound(object_key & ~0xFFU);
  return first != objects_.end() && (first->first >> 8U) == (object_key >> 8U);
}

hal::CanFrame CanopenNode::upload(std::uint32_t object_key) {
  const auto found = objects_.find(object_key);
  if (found == objects_.end()) { return sdo_answer(0x80, object_key, has_index(object_key) ? kNoSubIndex : kNoObject); }
  constexpr std::array<std::uint8_t, 5> kCommandOfSize{0x00, 0x4F, 0x4B, 0x47, 0x43};
  return sdo_answer(kCommandOfSize.at(found->second.size), object_key, found->second.value);
}

hal::CanFrame CanopenNode::download(const hal::CanFrame& request, std::uint32_t object_key) {
  const unsigned command = request.data[0];
  std::optional<unsigned> size;
  if ((command & 0x01U) != 0) { size = 4 - ((command >> 2U) & 0x03U); }
  const std::uint32_t value = little_endian(std::span(request.data).subspan(4, size.value_or(4)));
  const std::uint32_t refusal = why_refused(object_key, value, size);
  if (refusal != 0) { return sdo_answer(0x80, object_key, refusal); }
  objects_.at(object_key).value = value;
  return sdo_answer(0x60, object_key, 0);
}

std::uint32_t CanopenNode::why_refused(std::uint32_t object_key, std::uint32_t value, std::optional<unsigned> size) {
  const auto found = objects_.find(object_key);
  if (found == objects_.end()) { return has_index(object_key) ? kNoSubIndex : kNoObject; }
  if (!found->second.is_writable) { return kReadOnly; }
  if (size && *size != found->second.size) { return kWrongLength; }
  const bool is_mapping = (object_key >> 8U) == 0x1A00;
  if (is_mapping && (this->value(0x1800, 1) & kPdoOff) == 0) { return kWrongState; }
  return accept(object_key >> 8U, object_key & 0xFFU, value) ? 0 : kBadValue;
}

}  // namespace rosid::sim
