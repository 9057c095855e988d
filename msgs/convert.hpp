#pragma once
// The one place that turns rosid's own types into LCM messages. docs/messages.md describes the channels.

#include <cstdint>
#include <rosid/aid_t.hpp>
#include <rosid/fix_t.hpp>
#include <rosid/health_t.hpp>
#include <rosid/map_chunk_t.hpp>
#include <rosid/planar_lidar_t.hpp>
#include <rosid/pose_t.hpp>
#include <rosid/state_t.hpp>
#include <rosid/view_chunk_t.hpp>
#include <string>
#include <vector>

#include "base/samples.hpp"
#include "mapping/surface_map.hpp"
#include "msgs/epoch.hpp"
#include "msgs/health_report.hpp"

namespace rosid::msgs {

inline constexpr const char* kChannelPose = "ROSI_POSE";
inline constexpr const char* kChannelState = "ROSI_STATE";
inline constexpr const char* kChannelAid = "ROSI_AID";
inline constexpr const char* kChannelFixOut = "ROSI_FIX";
inline constexpr const char* kChannelLaserOut = "ROSI_LASER";
inline constexpr const char* kChannelView = "ROSI_VIEW";
inline constexpr const char* kChannelMap = "ROSI_MAP";
inline constexpr const char* kChannelHealth = "ROSI_HEALTH";

/// Largest encoded message: one datagram that fits the receive buffers of a machine nobody tuned.
inline constexpr std::size_t kMaxMessageBytes = 60'000;

pose_t to_pose_message(const PoseEstimate& estimate, EpochOffset epoch);
state_t to_state_message(const PoseEstimate& estimate, EpochOffset epoch);
aid_t to_aid_message(const AidReport& report, EpochOffset epoch);
fix_t to_fix_message(const SurfaceFix& fix, EpochOffset epoch);
planar_lidar_t to_laser_message(const ScanLine& line, EpochOffset epoch);

/// Every chunk is complete in itself and at most kMaxMessageBytes long; there is at least one. A boundary too long for
/// a message of its own is thinned out evenly.
std::vector<view_chunk_t> to_view_messages(const mapping::SurfaceView& view, EpochOffset epoch);
std::vector<map_chunk_t> to_map_messages(const mapping::SurfaceMap& map, EpochOffset epoch);

health_t to_health_message(const HealthReport& report, EpochOffset epoch);

}  // namespace rosid::msgs
