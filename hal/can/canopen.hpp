#pragma once
// The part of CANopen (CiA 301) that a listener of three sensors needs: frames of network management, expedited SDO
// and emergency messages, for the master and for the nodes. Pure.

#include <cstdint>
#include <optional>
#include <span>

#include "hal/front_end.hpp"

namespace rosid::hal::canopen {

/// Base identifiers; a node's own is base + node id.
namespace cob {
inline constexpr std::uint32_t kNmt = 0x000;
inline constexpr std::uint32_t kSync = 0x080;
inline constexpr std::uint32_t kEmergency = 0x080;
inline constexpr std::uint32_t kTpdo1 = 0x180;
inline constexpr std::uint32_t kSdoAnswer = 0x580;
inline constexpr std::uint32_t kSdoRequest = 0x600;
inline constexpr std::uint32_t kHeartbeat = 0x700;
}  // namespace cob

enum class NmtCommand : std::uint8_t {
  Start = 0x01,
  Stop = 0x02,
  PreOperational = 0x80,
  ResetNode = 0x81,
  ResetCommunication = 0x82,
};

/// First byte of a heartbeat.
enum class NodeState : std::uint8_t { BootUp = 0x00, Stopped = 0x04, Operational = 0x05, PreOperational = 0x7F };

/// An entry of an object dictionary.
struct Object {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  bool operator==(const Object&) const = default;
};

inline constexpr Object kProducerHeartbeat{0x1017, 0};   ///< u16, milliseconds
inline constexpr Object kTpdo1CobId{0x1800, 1};          ///< u32, bit 31: switched off
inline constexpr Object kTpdo1Type{0x1800, 2};           ///< u8, 0xFE or 0xFF: by event and timer
inline constexpr Object kTpdo1EventTimer{0x1800, 5};     ///< u16, milliseconds
inline constexpr Object kTpdo1Mapped{0x1A00, 0};         ///< u8, number of mapped objects
inline constexpr Object kTpdo1First{0x1A00, 1};          ///< u32, index, sub-index and bits of the first
inline constexpr Object kTpdo1Second{0x1A00, 2};         ///< u32, of the second
inline constexpr Object kEncoderTotalRange{0x6002, 0};   ///< u32, CiA 406
inline constexpr Object kEncoderPosition{0x6004, 0};     ///< u32, CiA 406
inline constexpr Object kEncoderCyclicTimer{0x6200, 0};  ///< u16, milliseconds, CiA 406
inline constexpr Object kTiltResolution{0x6000, 0};      ///< u16, 0.001 degrees, CiA 410

/// node_id 0: all nodes.
CanFrame nmt_frame(NmtCommand command, int node_id);
CanFrame heartbeat_frame(int node_id, NodeState state);
/// Data of up to 8 bytes under an 11-bit identifier.
CanFrame data_frame(std::uint32_t id, std::span<const std::uint8_t> data);

/// Expedited SDO; size 1, 2 or 4 bytes.
CanFrame sdo_read_request(int node_id, Object object);
CanFrame sdo_write_request(int node_id, Object object, std::uint32_t value, int size);
CanFrame sdo_read_answer(int node_id, Object object, std::uint32_t value, int size);
CanFrame sdo_write_answer(int node_id, Object object);
CanFrame sdo_abort(std::uint32_t cob_base, int node_id, Object object, std::uint32_t code);

/// What a server answered, or a client asked.
struct SdoMessage {
  enum class Kind : std::uint8_t { Read, Write, Abort, Other };
  Kind kind = Kind::Other;
  Object object;
  std::uint32_t value = 0;  ///< value read or written, or the abort code
  int size = 0;             ///< bytes of the value; 4 when the sender did not say
};

/// From a frame on the answer identifier: Read carries the value, Write is the confirmation. Nothing for a frame that
/// is no 8-byte data frame. Segmented transfers are Other.
std::optional<SdoMessage> parse_sdo_answer(const CanFrame& frame);
/// From a frame on the request identifier (for the node's side): Write carries the value.
std::optional<SdoMessage> parse_sdo_request(const CanFrame& frame);

/// What an emergency code means, for a person. Static storage; never null.
const char* emergency_text(std::uint16_t code);

/// The code says that the measured value itself is wrong or out of range, not only that communication suffered.
bool concerns_measurement(std::uint16_t code);

}  // namespace rosid::hal::canopen
