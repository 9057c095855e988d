#pragma once
// Bodies of the drive log's events, byte for byte what lcm-gen's code for raw_config_t, raw_laser_t, raw_can_t,
// raw_gpio_t and raw_fix_t writes (a test compares them). Written out because the generated decoders trust the length
// fields they read.

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "msgs/log.hpp"

namespace rosid::msgs {

inline constexpr std::string_view kChannelConfig = "RAW_CONFIG";
inline constexpr std::string_view kChannelLaser = "RAW_LASER";
inline constexpr std::string_view kChannelCan = "RAW_CAN";
inline constexpr std::string_view kChannelGpio = "RAW_GPIO";
inline constexpr std::string_view kChannelFix = "RAW_FIX";

std::string_view channel_of(const LogRecord& record);
bool is_log_channel(std::string_view channel);

/// Appends the payload.
void encode_payload(const LogRecord& record, std::vector<std::uint8_t>& out);

/// Nothing when the bytes are not a message of that channel.
std::optional<LogRecord> decode_payload(std::string_view channel, std::span<const std::uint8_t> payload);

}  // namespace rosid::msgs
