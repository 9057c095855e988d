#include "hal/can/node.hpp"

#include <algorithm>

namespace rosid::hal::canopen {

namespace {

using std::chrono::milliseconds;

constexpr Duration kSdoTimeout = milliseconds(150);
constexpr Duration kFirstData = milliseconds(1000);
constexpr Duration kPauseMin = milliseconds(200);
constexpr Duration kPauseMax = milliseconds(5000);
constexpr Duration kRestartPause = milliseconds(200);  // between two start commands to a node that is not operational
constexpr int kTries = 3;
constexpr int kBadStreak = 10;

constexpr std::uint32_t kCobIdMask = 0x7FF;
constexpr std::uint32_t kCobExtended = 1U << 29U;
constexpr std::uint32_t kCobOff = 1U << 31U;

}  // namespace

Node::Node(int node_id, Duration silence_limit, std::span<const SetupStep> steps, NodeActions& actions)
    : node_id_(node_id),
      tpdo1_id_(cob::kTpdo1 + static_cast<std::uint32_t>(node_id)),
      silence_limit_(silence_limit),
      steps_(steps),
      actions_(actions) {}

Node::Node(PlainFrame frame, Duration silence_limit, NodeActions& actions)
    : node_id_(0), plain_(frame), tpdo1_id_(frame.id), silence_limit_(silence_limit), actions_(actions) {}

void Node::on_link(Time now, bool is_open) {
  has_delivered_ = false;
  is_lost_ = false;
  is_heard_ = false;
  is_mapping_wrong_ = false;  // it may be another device
  bad_streak_ = 0;
  emergency_ = 0;
  pause_ = kPauseMin;
  if (!plain_) { tpdo1_id_ = cob::kTpdo1 + static_cast<std::uint32_t>(node_id_); }
  if (is_open) {
    begin(now);
    return;
  }
  phase_ = Phase::Closed;
  deadline_ = Time::max();
}

void Node::begin(Time now) {
  ++counters_.setups;
  phase_ = Phase::Setup;
  has_answered_ = false;
  is_mapping_refused_ = false;
  tpdo1_entry_ = cob::kTpdo1 + static_cast<std::uint32_t>(node_id_);
  step_ = 0;
  tries_ = 0;
  send_nmt(NmtCommand::PreOperational);
  if (steps_.empty()) {
    start_node(now);
  } else {
    send_step(now);
  }
}

void Node::send_step(Time now) {
  const SetupStep& step = steps_[step_];
  ++tries_;
  deadline_ = now + kSdoTimeout;
  switch (step.kind) {
    case SetupStep::Kind::Read:
    case SetupStep::Kind::ReadMapping: actions_.send(sdo_read_request(node_id_, step.object)); break;
    case SetupStep::Kind::Write:
    case SetupStep::Kind::WriteIfRefused:
    case SetupStep::Kind::WriteMapping:
      actions_.send(sdo_write_request(node_id_, step.object, step.value, step.size));
      break;
    case SetupStep::Kind::DisableTpdo1:
      tpdo1_entry_ |= kCobOff;
      actions_.send(sdo_write_request(node_id_, step.object, tpdo1_entry_, 4));
      break;
    case SetupStep::Kind::EnableTpdo1:
      actions_.send(sdo_write_request(node_id_, step.object, tpdo1_entry_ & ~kCobOff, 4));
      break;
  }
}

bool Node::is_skipped(const SetupStep& step, bool was_refused) const {
  switch (step.kind) {
    case SetupStep::Kind::WriteIfRefused: return !was_refused;
    case SetupStep::Kind::DisableTpdo1:
    case SetupStep::Kind::WriteMapping: return !is_mapping_wrong_;
    case SetupStep::Kind::EnableTpdo1: return (tpdo1_entry_ & kCobOff) == 0U;
    default: return false;
  }
}

bool Node::is_read_step() const {
  return steps_[step_].kind == SetupStep::Kind::Read || steps_[step_].kind == SetupStep::Kind::ReadMapping;
}

void Node::next_step(Time now, bool was_refused) {
  if (was_refused && steps_[step_].kind == SetupStep::Kind::WriteMapping) { is_mapping_refused_ = true; }
  ++step_;
  while (step_ < steps_.size() && is_skipped(steps_[step_], was_refused)) {
    was_refused = false;
    ++step_;
  }
  tries_ = 0;
  if (step_ < steps_.size()) {
    send_step(now);
  } else {
    start_node(now);
  }
}

void Node::start_node(Time now) {
  phase_ = Phase::Starting;
  t_last_start_ = now;
  send_nmt(NmtCommand::Start);
  deadline_ = now + kFirstData;
}

void Node::on_deadline(Time now) {
  switch (phase_) {
    case Phase::Closed: deadline_ = Time::max(); break;
    case Phase::BackOff: begin(now); break;
    case Phase::Setup:
      if (tries_ < kTries) {
        send_step(now);
        break;
      }
      ++counters_.sdo_timeouts;
      if (has_answered_) {
        next_step(now, true);
      } else {
        start_node(now);
      }
      break;
    case Phase::Starting:
      phase_ = Phase::BackOff;
      deadline_ = now + pause_;
      pause_ = std::min(2 * pause_, kPauseMax);
      break;
    case Phase::Running:
      is_lost_ = true;
      begin(now);
      break;
  }
}

bool Node::on_frame(Time t_receive, const CanFrame& frame) {
  if (phase_ == Phase::Closed || frame.is_error) { return false; }
  const auto id = static_cast<std::uint32_t>(node_id_);
  const bool is_extended_wanted = plain_ && plain_->is_extended;
  // An identifier of the other length is another identifier; a node's own would only be a collision.
  if (plain_ && frame.is_extended != is_extended_wanted) { return false; }
  const bool is_data = frame.id == tpdo1_id_;
  const bool is_sdo = !plain_ && frame.id == cob::kSdoAnswer + id;
  const bool is_heartbeat = !plain_ && frame.id == cob::kHeartbeat + id;
  const bool is_emergency = !plain_ && frame.id == cob::kEmergency + id;
  if (!is_data && !is_sdo && !is_heartbeat && !is_emergency) { return false; }
  if (frame.is_extended != is_extended_wanted || frame.is_remote || frame.length > 8) {
    ++counters_.format_errors;
    return true;
  }
  is_heard_ = true;
  counters_.bytes += frame.length;
  if (is_data) {
    on_data(t_receive, frame);
  } else if (is_sdo) {
    on_sdo(t_receive, frame);
  } else if (is_heartbeat) {
    on_heartbeat(t_receive, frame);
  } else {
    on_emergency(frame);
  }
  return true;
}

void Node::on_sdo(Time now, const CanFrame& frame) {
  const std::optional<SdoMessage> message = parse_sdo_answer(frame);
  if (!message) {
    ++counters_.format_errors;
    return;
  }
  if (phase_ != Phase::Setup || message->object != steps_[step_].object) { return; }  // an answer that came too late
  has_answered_ = true;
  if (message->kind == SdoMessage::Kind::Abort) { ++counters_.sdo_aborts; }
  const bool is_read = is_read_step();
  const auto expected = is_read ? SdoMessage::Kind::Read : SdoMessage::Kind::Write;
  const bool is_done = message->kind == expected;
  if (is_done && is_read) {
    if (message->object == kTpdo1CobId) {
      const std::uint32_t cob_id = message->value & kCobIdMask;
      // Never written back with identifier 0: that is the master's.
      tpdo1_entry_ = cob_id != 0 ? message->value : (message->value & ~kCobIdMask) | tpdo1_entry_;
      if (cob_id != 0 && (message->value & kCobExtended) == 0U) { tpdo1_id_ = cob_id; }
    }
    const SetupStep& step = steps_[step_];
    // Of the number of entries the first ones are of use; more may follow.
    const bool is_enough = step.object == kTpdo1Mapped ? message->value >= step.value : message->value == step.value;
    // The number of entries is the first that is read of the mapping.
    const bool was_wrong = is_mapping_wrong_ && step.object != kTpdo1Mapped;
    if (step.kind == SetupStep::Kind::ReadMapping) { is_mapping_wrong_ = was_wrong || !is_enough; }
    actions_.on_object(message->object, message->value);
  }
  const SetupStep& step = steps_[step_];
  const bool is_in_use = step.object == kTpdo1Mapped && step.value != 0;
  // All of it was written, or the next set-up reads what it is now.
  if (is_done && step.kind == SetupStep::Kind::WriteMapping && is_in_use) { is_mapping_wrong_ = is_mapping_refused_; }
  next_step(now, !is_done);
}

void Node::on_heartbeat(Time now, const CanFrame& frame) {
  if (frame.length != 1) {
    ++counters_.format_errors;
    return;
  }
  // Bit 7 toggles with the old node guarding.
  const auto node_state = static_cast<std::uint8_t>(frame.data[0] & 0x7FU);
  if (node_state == static_cast<std::uint8_t>(NodeState::BootUp)) {
    ++counters_.reboots;
    emergency_ = 0;
    is_mapping_wrong_ = false;  // it may be another device
    actions_.on_reboot();
    begin(now);
    return;
  }
  const bool is_expected_to_run = phase_ == Phase::Running || phase_ == Phase::Starting;
  const bool is_operational = node_state == static_cast<std::uint8_t>(NodeState::Operational);
  if (is_expected_to_run && !is_operational && now - t_last_start_ >= kRestartPause) {
    t_last_start_ = now;
    send_nmt(NmtCommand::Start);
  }
}

void Node::on_emergency(const CanFrame& frame) {
  if (frame.length < 2) {
    ++counters_.format_errors;
    return;
  }
  const auto code =
      static_cast<std::uint16_t>(static_cast<unsigned>(frame.data[0]) | (static_cast<unsigned>(frame.data[1]) << 8U));
  if (code != 0) { ++counters_.emergencies; }
  emergency_ = code;
}

void Node::on_data(Time t, const CanFrame& frame) {
  if (has_delivered_ && t <= t_last_frame_) {
    const bool is_same = t == t_last_frame_ && frame.length == last_length_ && frame.data == last_data_;
    ++(is_same ? counters_.duplicates : counters_.rejected);
    return;
  }
  t_last_frame_ = t;
  last_data_ = frame.data;
  last_length_ = frame.length;
  has_delivered_ = true;
  if (is_mapping_wrong_) {
    // Not what it would be taken for; the set-up is repeated, with growing pauses, as if nothing had come.
    bad_streak_ = std::min(bad_streak_ + 1, kBadStreak);
    ++counters_.format_errors;
    return;
  }
  const Verdict verdict = actions_.on_process_data(t, std::span(frame.data).first(frame.length));
  switch (verdict) {
    case Verdict::Accepted:
      bad_streak_ = 0;
      ++counters_.samples;
      t_last_data_ = t;
      break;
    case Verdict::Rejected:
      bad_streak_ = std::min(bad_streak_ + 1, kBadStreak);
      ++counters_.rejected;
      break;
    case Verdict::Malformed:
      bad_streak_ = std::min(bad_streak_ + 1, kBadStreak);
      ++counters_.format_errors;
      break;
  }
  // During the set-up a node that was already running goes on; its data are as good as later.
  if (phase_ == Phase::Starting || phase_ == Phase::BackOff || phase_ == Phase::Running) {
    phase_ = Phase::Running;
    is_lost_ = false;
    pause_ = kPauseMin;
    deadline_ = t + silence_limit_;
  }
}

void Node::send_nmt(NmtCommand command) {
  if (plain_) { return; }
  actions_.send(nmt_frame(command, node_id_));
}

bool Node::is_wrongly_mapped() const {
  return is_mapping_wrong_ && bad_streak_ >= kBadStreak;
}

DeviceState Node::state() const {
  if (phase_ == Phase::Closed) { return DeviceState::Absent; }
  if (is_wrongly_mapped()) { return DeviceState::Faulty; }
  if (phase_ == Phase::Running) {
    const bool is_faulty = bad_streak_ >= kBadStreak || (emergency_ != 0 && concerns_measurement(emergency_));
    return is_faulty ? DeviceState::Faulty : DeviceState::Running;
  }
  if (is_lost_) { return DeviceState::Silent; }
  return is_heard_ ? DeviceState::Configuring : DeviceState::Connecting;
}

const char* Node::detail() const {
  if (emergency_ != 0) { return emergency_text(emergency_); }
  if (is_wrongly_mapped()) {
    return "its process data are mapped otherwise (1A00h), and it does not let them be mapped";
  }
  switch (phase_) {
    case Phase::Closed: return "link is closed";
    case Phase::Setup:
    case Phase::Starting:
      if (pause_ > kPauseMin) { break; }  // not the first attempt
      if (plain_) { return "no frame with this identifier yet"; }
      return phase_ == Phase::Setup ? "setting up by SDO" : "started, no process data yet";
    case Phase::Running: return bad_streak_ >= kBadStreak ? "process data make no sense" : "running";
    case Phase::BackOff: break;
  }
  if (plain_) { return "no frame with this identifier; check signal_id, bit rate and termination"; }
  return is_heard_ ? "answers, but sends no process data (TPDO1); check its mapping and event timer"
                   : "no frame from this node; check node number, bit rate and termination";
}

}  // namespace rosid::hal::canopen
