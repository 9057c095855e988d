#include "hal/can/canopen.hpp"

#include <algorithm>
#include <array>

#include "base/contract.hpp"

namespace rosid::hal::canopen {

namespace {

// Command bytes of expedited transfers.
constexpr std::uint8_t kReadRequest = 0x40;
constexpr std::uint8_t kWriteConfirmed = 0x60;
constexpr std::uint8_t kAbort = 0x80;
constexpr unsigned kExpedited = 0x02;
constexpr unsigned kSizeIndicated = 0x01;
constexpr unsigned kCommandMask = 0xE0;
constexpr unsigned kWriteRequestBits = 0x20;
constexpr unsigned kReadAnswerBits = 0x40;

constexpr std::uint8_t byte_of(std::uint32_t value, unsigned k) {
  return static_cast<std::uint8_t>((value >> (8U * k)) & 0xFFU);
}

std::uint32_t node_cob(std::uint32_t base, int node_id) {
  ROSID_EXPECT(node_id >= 1 && node_id <= 127);
  return base + static_cast<std::uint32_t>(node_id);
}

CanFrame sdo_frame(std::uint32_t id, unsigned command, Object object, std::uint32_t value) {
  CanFrame frame{.id = id, .length = 8};
  frame.data = {static_cast<std::uint8_t>(command),
                byte_of(object.index, 0),
                byte_of(object.index, 1),
                object.sub,
                byte_of(value, 0),
                byte_of(value, 1),
                byte_of(value, 2),
                byte_of(value, 3)};
  return frame;
}

/// e = expedited, s = size indicated, n = unused bytes.
unsigned expedited_command(unsigned bits, int size) {
  ROSID_EXPECT(size >= 1 && size <= 4);
  return bits | kExpedited | kSizeIndicated | (static_cast<unsigned>(4 - size) << 2U);
}

struct Fields {
  unsigned command;
  Object object;
  std::uint32_t value;
};

std::optional<Fields> sdo_fields(const CanFrame& frame) {
  if (frame.length != 8 || frame.is_extended || frame.is_remote || frame.is_error) { return std::nullopt; }
  const auto& d = frame.data;
  const auto u = [&d](std::size_t k) { return static_cast<std::uint32_t>(d[k]); };
  return Fields{d[0],
                {static_cast<std::uint16_t>(u(1) | (u(2) << 8U)), d[3]},
                u(4) | (u(5) << 8U) | (u(6) << 16U) | (u(7) << 24U)};
}

/// Value and size of an expedited transfer; nothing for a segmented one.
std::optional<SdoMessage> expedited_value(SdoMessage::Kind kind, const Fields& fields) {
  if ((fields.command & kExpedited) == 0U) { return std::nullopt; }
  const bool has_size = (fields.command & kSizeIndicated) != 0U;
  const int size = has_size ? 4 - static_cast<int>((fields.command >> 2U) & 3U) : 4;
  const std::uint32_t mask = size == 4 ? 0xFFFFFFFFU : (1U << (8U * static_cast<unsigned>(size))) - 1U;
  return SdoMessage{kind, fields.object, fields.value & mask, size};
}

}  // namespace

CanFrame nmt_frame(NmtCommand command, int node_id) {
  ROSID_EXPECT(node_id >= 0 && node_id <= 127);
  CanFrame frame{.id = cob::kNmt, .length = 2};
  frame.data[0] = static_cast<std::uint8_t>(command);
  frame.data[1] = static_cast<std::uint8_t>(node_id);
  return frame;
}

CanFrame heartbeat_frame(int node_id, NodeState state) {
  CanFrame frame{.id = node_cob(cob::kHeartbeat, node_id), .length = 1};
  frame.data[0] = static_cast<std::uint8_t>(state);
  return frame;
}

CanFrame data_frame(std::uint32_t id, std::span<const std::uint8_t> data) {
  ROSID_EXPECT(data.size() <= 8);
  CanFrame frame{.id = id, .length = static_cast<std::uint8_t>(data.size())};
  std::copy(data.begin(), data.end(), frame.data.begin());
  return frame;
}

CanFrame sdo_read_request(int node_id, Object object) {
  return sdo_frame(node_cob(cob::kSdoRequest, node_id), kReadRequest, object, 0);
}

CanFrame sdo_write_request(int node_id, Object object, std::uint32_t value, int size) {
  return sdo_frame(node_cob(cob::kSdoRequest, node_id), expedited_command(kWriteRequestBits, size), object, value);
}

CanFrame sdo_read_answer(int node_id, Object object, std::uint32_t value, int size) {
  return sdo_frame(node_cob(cob::kSdoAnswer, node_id), expedited_command(kReadAnswerBits, size), object, value);
}

CanFrame sdo_write_answer(int node_id, Object object) {
  return sdo_frame(node_cob(cob::kSdoAnswer, node_id), kWriteConfirmed, object, 0);
}

CanFrame sdo_abort(std::uint32_t cob_base, int node_id, Object object, std::uint32_t code) {
  return sdo_frame(node_cob(cob_base, node_id), kAbort, object, code);
}

std::optional<SdoMessage> parse_sdo_answer(const CanFrame& frame) {
  const std::optional<Fields> fields = sdo_fields(frame);
  if (!fields) { return std::nullopt; }
  const SdoMessage other{.kind = SdoMessage::Kind::Other, .object = fields->object};
  if (fields->command == kAbort) { return SdoMessage{SdoMessage::Kind::Abort, fields->object, fields->value, 4}; }
  if (fields->command == kWriteConfirmed) { return SdoMessage{SdoMessage::Kind::Write, fields->object, 0, 0}; }
  if ((fields->command & kCommandMask) != kReadAnswerBits) { return other; }
  return expedited_value(SdoMessage::Kind::Read, *fields).value_or(other);
}

std::optional<SdoMessage> parse_sdo_request(const CanFrame& frame) {
  const std::optional<Fields> fields = sdo_fields(frame);
  if (!fields) { return std::nullopt; }
  const SdoMessage other{.kind = SdoMessage::Kind::Other, .object = fields->object};
  if (fields->command == kAbort) { return SdoMessage{SdoMessage::Kind::Abort, fields->object, fields->value, 4}; }
  if (fields->command == kReadRequest) { return SdoMessage{SdoMessage::Kind::Read, fields->object, 0, 0}; }
  if ((fields->command & kCommandMask) != kWriteRequestBits) { return other; }
  return expedited_value(SdoMessage::Kind::Write, *fields).value_or(other);
}

const char* emergency_text(std::uint16_t code) {
  struct Entry {
    std::uint16_t code;
    std::uint16_t mask;
    const char* text;
  };
  // Special codes before the classes they belong to.
  constexpr std::array<Entry, 24> kEntries{{
      {0x0000, 0xFFFF, "error reset, no error"},
      {0x5010, 0xFFFF, "longitudinal axis out of range or sensor error"},
      {0x5020, 0xFFFF, "lateral axis out of range or sensor error"},
      {0x8110, 0xFFFF, "CAN overrun, messages lost in the node"},
      {0x8120, 0xFFFF, "CAN controller of the node in error-passive mode"},
      {0x8130, 0xFFFF, "heartbeat or life guarding failed"},
      {0x8140, 0xFFFF, "node recovered from bus-off"},
      {0x8210, 0xFFFF, "PDO not processed because of its length"},
      {0x8220, 0xFFFF, "PDO too long"},
      {0x1000, 0xF000, "generic error"},
      {0x2000, 0xF000, "current"},
      {0x3100, 0xFF00, "mains voltage"},
      {0x3200, 0xFF00, "supply voltage inside the node"},
      {0x3000, 0xF000, "voltage"},
      {0x4200, 0xFF00, "node temperature"},
      {0x4000, 0xF000, "temperature"},
      {0x5000, 0xF000, "node hardware"},
      {0x6300, 0xFF00, "data set of the node"},
      {0x6000, 0xF000, "node software"},
      {0x7000, 0xF000, "additional modules"},
      {0x8100, 0xFF00, "communication"},
      {0x8000, 0xF000, "monitoring"},
      {0x9000, 0xF000, "external error"},
      {0xF000, 0xF000, "additional functions or device-specific"},
  }};
  for (const Entry& entry : kEntries) {
    if ((code & entry.mask) == entry.code) { return entry.text; }
  }
  return "unknown code";
}

bool concerns_measurement(std::uint16_t code) {
  constexpr unsigned kClassMask = 0xF000;
  const unsigned error_class = code & kClassMask;
  return error_class == 0x5000U || error_class == 0x6000U || error_class == 0xF000U;
}

}  // namespace rosid::hal::canopen
