#include "msgs/convert.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/pose.hpp"
#include "base/units.hpp"

namespace rosid::msgs {

namespace {

// LCM's generated types have C arrays.
// NOLINTBEGIN(modernize-avoid-c-arrays)
template <typename Source, typename Target, std::size_t Size>
void copy_to(const Source& source, Target (&target)[Size]) {
  static_assert(std::tuple_size_v<Source> == Size);
  std::copy(source.begin(), source.end(), target);
}

void copy_vector(const Vec3& source, double (&target)[3]) {
  std::copy_n(source.data(), 3, target);
}
// NOLINTEND(modernize-avoid-c-arrays)

std::int32_t to_int32(std::uint64_t value) {
  return static_cast<std::int32_t>(std::min<std::uint64_t>(value, std::numeric_limits<std::int32_t>::max()));
}

}  // namespace

pose_t to_pose_message(const PoseEstimate& estimate, EpochOffset epoch) {
  pose_t message{};
  message.utime = epoch.utime(estimate.t);
  copy_to(estimate.X_WV.p_m, message.pos);
  copy_to(estimate.X_WV.q_wxyz, message.orientation);
  const auto& twist = estimate.twist_V;
  const Mat3 R_WV = to_transform(estimate.X_WV).rotation();
  copy_vector(R_WV * Vec3(twist[0], twist[1], twist[2]), message.vel);
  copy_vector(R_WV * Vec3(twist[3], twist[4], twist[5]), message.rotation_rate);
  return message;
}

state_t to_state_message(const PoseEstimate& estimate, EpochOffset epoch) {
  state_t message{};
  message.utime = epoch.utime(estimate.t);
  message.sequence = static_cast<std::int32_t>(estimate.sequence);
  message.fixes_applied = static_cast<std::int32_t>(estimate.fixes_applied);
  message.status = static_cast<std::int32_t>(estimate.status);
  copy_to(estimate.X_WV.p_m, message.position_WV);
  copy_to(estimate.X_WV.q_wxyz, message.orientation_WV);
  copy_to(estimate.X_OV.p_m, message.position_OV);
  copy_to(estimate.X_OV.q_wxyz, message.orientation_OV);
  copy_to(estimate.X_WO.p_m, message.position_WO);
  copy_to(estimate.X_WO.q_wxyz, message.orientation_WO);
  copy_to(estimate.covariance_W, message.covariance_WV);
  copy_to(estimate.twist_V, message.twist_V);
  copy_to(estimate.wheel_scale, message.wheel_scale);
  copy_to(estimate.tilt_bias, message.tilt_bias);
  return message;
}

aid_t to_aid_message(const AidReport& report, EpochOffset epoch) {
  aid_t message{};
  message.utime = epoch.utime(report.t_measured);
  message.utime_fused = epoch.utime(report.t_fused);
  message.view_id = static_cast<std::int32_t>(report.view_id);
  message.aid = static_cast<std::int8_t>(report.aid);
  message.outcome = static_cast<std::int8_t>(report.outcome);
  message.dof = static_cast<std::int8_t>(report.dof);
  message.test_ratio = report.test_ratio;
  message.nis = report.nis;
  copy_to(report.innovation, message.innovation);
  copy_to(report.innovation_variance, message.innovation_variance);
  return message;
}

fix_t to_fix_message(const SurfaceFix& fix, EpochOffset epoch) {
  fix_t message{};
  message.utime = epoch.utime(fix.t_view);
  message.t_ns = to_ns(fix.t_view);
  message.view_id = static_cast<std::int32_t>(fix.view_id);
  message.pair_count = fix.pair_count;
  message.null_count = fix.null_count;
  message.chi2 = fix.chi2;
  message.chi2_dof = fix.chi2_dof;
  message.confidence = fix.confidence;
  copy_to(fix.X_WV.p_m, message.position_WV);
  copy_to(fix.X_WV.q_wxyz, message.orientation_WV);
  copy_to(fix.information, message.information);
  copy_to(fix.covariance_correlated, message.covariance_correlated);
  copy_to(fix.null_directions, message.null_directions);
  return message;
}

planar_lidar_t to_laser_message(const ScanLine& line, EpochOffset epoch) {
  planar_lidar_t message{};
  message.utime = epoch.utime(line.t_first_beam);
  message.rad0 = static_cast<float>(line.first_angle_rad - (kPi / 2.0));
  message.radstep = static_cast<float>(line.angle_step_rad);
  const std::size_t count = std::min<std::size_t>(line.beam_count, line.range_m.size());
  message.ranges.assign(line.range_m.begin(), line.range_m.begin() + static_cast<std::ptrdiff_t>(count));
  for (float& range : message.ranges) {
    if (!std::isfinite(range)) { range = 0.0F; }
  }
  message.nranges = static_cast<std::int32_t>(message.ranges.size());
  return message;
}

health_t to_health_message(const HealthReport& report, EpochOffset epoch) {
  health_t message{};
  message.utime = epoch.utime(report.t);
  message.realtime = report.is_realtime ? 1 : 0;
  message.views = static_cast<std::int64_t>(report.views);
  message.views_failed = static_cast<std::int64_t>(report.views_failed);
  message.lcm_errors = static_cast<std::int64_t>(report.lcm_errors);
  message.storage_errors = static_cast<std::int64_t>(report.storage_errors);
  for (std::size_t k = 0; k < report.devices.size(); ++k) {
    const DeviceHealth& device = report.devices[k];
    message.device_name.emplace_back(to_cstr(static_cast<Device>(k)));
    message.device_state.push_back(static_cast<std::int8_t>(device.state));
    message.device_age_s.push_back(device.samples == 0 ? -1.0F
                                                       : static_cast<float>(to_s(report.t - device.t_last_data)));
    message.bytes.push_back(static_cast<std::int64_t>(device.bytes));
    message.samples.push_back(static_cast<std::int64_t>(device.samples));
    message.checksum_errors.push_back(static_cast<std::int64_t>(device.checksum_errors));
    message.format_errors.push_back(static_cast<std::int64_t>(device.format_errors));
    message.lost.push_back(static_cast<std::int64_t>(device.lost));
    message.rejected.push_back(static_cast<std::int64_t>(device.rejected));
    message.reconnects.push_back(static_cast<std::int64_t>(device.reconnects));
    message.emergencies.push_back(static_cast<std::int64_t>(device.emergencies));
  }
  for (const NamedThreadHealth& thread : report.threads) {
    message.thread_name.push_back(thread.name);
    message.cycles.push_back(static_cast<std::int64_t>(thread.health.cycles));
    message.overruns.push_back(static_cast<std::int64_t>(thread.health.overruns));
    message.cycle_mean_s.push_back(static_cast<float>(thread.health.cycle_mean_s));
    message.cycle_max_s.push_back(static_cast<float>(thread.health.cycle_max_s));
    message.wakeup_max_s.push_back(static_cast<float>(thread.health.wakeup_max_s));
  }
  for (const QueueHealth& queue : report.queues) {
    message.queue_name.push_back(queue.name);
    message.queue_dropped.push_back(static_cast<std::int64_t>(queue.dropped));
    message.queue_high_water.push_back(to_int32(queue.high_water));
    message.queue_capacity.push_back(to_int32(queue.capacity));
  }
  message.ndevices = static_cast<std::int32_t>(message.device_name.size());
  message.nthreads = static_cast<std::int32_t>(message.thread_name.size());
  message.nqueues = static_cast<std::int32_t>(message.queue_name.size());
  return message;
}

}  // namespace rosid::msgs
