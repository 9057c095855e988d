#pragma once
// Every key of rosid's configuration, listed once: the same functions read a file and write one.
//
// A visitor has table(name, fill), boolean, integer, number, angle, text, booleans and choice members, each taking the
// key and the variable. Limits are the modules' business: their validate() states the rules.

#include <array>
#include <initializer_list>
#include <span>
#include <string_view>
#include <utility>

#include "config/loader.hpp"

namespace rosid::config {

template <typename Visitor>
void visit_fields(Visitor& v, hal::LaserConfig& c) {
  v.boolean("enabled", c.enabled);
  v.choice("link", c.link, {{"tty", hal::LaserLinkKind::Tty}, {"usb", hal::LaserLinkKind::Usb}});
  v.text("device", c.device);
  v.text("usb_serial", c.usb_serial);
  v.text("usb_ids", c.usb_ids);
  v.integer("usb_channel", c.usb_channel);
  v.integer("baud", c.baud);
  v.choice("mode", c.mode, {{"partial", hal::LaserMode::Partial}, {"complete", hal::LaserMode::Complete}});
  v.integer("opening_deg", c.opening_deg);
  v.number("resolution_deg", c.resolution_deg);
  v.number("silence_limit_s", c.silence_limit_s);
}

template <typename Visitor>
void visit_fields(Visitor& v, hal::CanConfig& c) {
  v.boolean("enabled", c.enabled);
  v.choice("link", c.link, {{"socketcan", hal::CanLink::SocketCan}, {"slcan", hal::CanLink::Slcan}});
  v.text("device", c.device);
  v.integer("bitrate", c.bitrate);
}

template <typename Visitor>
void visit_signal(Visitor& v, hal::SignalConfig& c) {
  v.integer("signal_id", c.id);
  v.boolean("signal_extended", c.extended);
  v.integer("signal_offset_bits", c.offset_bits);
  v.integer("signal_length_bits", c.length_bits);
  v.choice("signal_order", c.order, {{"little", hal::ByteOrder::Little}, {"big", hal::ByteOrder::Big}});
}

template <typename Visitor>
void visit_fields(Visitor& v, hal::EncoderConfig& c, bool is_turret) {
  v.boolean("enabled", c.enabled);
  if (is_turret) { v.choice("link", c.link, {{"can", hal::EncoderLink::Can}, {"gpio", hal::EncoderLink::Gpio}}); }
  v.integer("node_id", c.node_id);
  if (is_turret) { v.number("counts_per_turn", c.counts_per_turn); }
  v.boolean("reversed", c.reversed);
  v.number("silence_limit_s", c.silence_limit_s);
  visit_signal(v, c.signal);
  v.integer("signal_range", c.signal.range);
}

template <typename Visitor>
void visit_fields(Visitor& v, hal::GpioConfig& c) {
  v.text("chip", c.chip);
  v.text("line_a", c.line_a);
  v.text("line_b", c.line_b);
  v.text("line_z", c.line_z);
  v.integer("debounce_us", c.debounce_us);
}

template <typename Visitor>
void visit_fields(Visitor& v, hal::TiltConfig& c) {
  v.boolean("enabled", c.enabled);
  v.integer("node_id", c.node_id);
  v.boolean("swap_axes", c.swap_axes);
  v.booleans("reversed", c.reversed);
  v.number("silence_limit_s", c.silence_limit_s);
  visit_signal(v, c.signal);
  v.integer("signal_lateral_offset_bits", c.signal_lateral_offset_bits);
  v.number("signal_scale_deg", c.signal_scale_deg);
}

template <typename Visitor>
void visit_fields(Visitor& v, estimator::EstimatorConfig& c) {
  v.number("step_s", c.step_s);
  v.number("horizon_lag_s", c.horizon_lag_s);
  v.number("history_s", c.history_s);
  v.number("wheel_sigma_m_per_sqrt_m", c.wheel_sigma_m_per_sqrt_m);
  v.number("slope_sigma_rad_per_sqrt_m", c.slope_sigma_rad_per_sqrt_m);
  v.number("turn_slip_sigma_rad_per_sqrt_rad", c.turn_slip_sigma_rad_per_sqrt_rad);
  v.number("heading_sigma_rad_per_sqrt_m", c.heading_sigma_rad_per_sqrt_m);
  v.number("lateral_sigma_m_per_sqrt_m", c.lateral_sigma_m_per_sqrt_m);
  v.number("vertical_sigma_m_per_sqrt_m", c.vertical_sigma_m_per_sqrt_m);
  v.number("wheel_scale_walk_per_sqrt_m", c.wheel_scale_walk_per_sqrt_m);
  v.number("tilt_bias_walk_rad_per_sqrt_s", c.tilt_bias_walk_rad_per_sqrt_s);
  v.number("acceleration_sigma_mps2", c.acceleration_sigma_mps2);
  v.number("slope_inflation", c.slope_inflation);
  v.number("slip_inflation", c.slip_inflation);
  v.number("stationary_after_s", c.stationary_after_s);
  v.number("coasting_acceleration_sigma_mps2", c.coasting_acceleration_sigma_mps2);
}

template <typename Visitor>
void visit_fields(Visitor& v, mapping::MappingConfig& c) {
  v.angle("opening", c.assembler.opening_rad);
  v.angle("seam", c.assembler.seam_rad);
  v.number("range_min_m", c.assembler.range_min_m);
  v.number("range_max_m", c.assembler.range_max_m);
  v.integer("max_lines", c.assembler.max_lines);
  v.integer("min_patch_pixels", c.segmenter.min_patch_pixels);
  v.number("min_patch_area_m2", c.segmenter.min_patch_area_m2);
  v.integer("min_patch_lines", c.segmenter.min_patch_lines);
  v.angle("merge_angle_max", c.segmenter.merge_angle_max_rad);
  v.number("gate_probability", c.matcher.gate_probability);
  v.integer("min_pairs", c.matcher.min_pairs);
  v.integer("max_iterations", c.matcher.max_iterations);
  v.number("snap_distance_m", c.fusion.snap_distance_m);
  v.integer("max_patches", c.fusion.max_patches);
  v.integer("max_ring_vertices", c.fusion.max_ring_vertices);
  v.number("min_confidence", c.fusion.min_confidence);
}

template <typename Visitor>
void visit_fields(Visitor& v, OutputConfig& c) {
  v.boolean("lcm_enabled", c.lcm_enabled);
  v.text("lcm_url", c.lcm_url);
  v.text("state_directory", c.state_directory);
  v.boolean("record", c.record);
  v.number("autosave_s", c.autosave_s);
}

template <typename Visitor>
void visit_fields(Visitor& v, RuntimeConfig& c) {
  v.boolean("realtime", c.realtime);
  v.boolean("require_realtime", c.require_realtime);
}

/// All tables but [calibration], which has its own list.
template <typename Visitor>
void visit_tables(Visitor& v, RosidConfig& c) {
  v.table("laser", [&](auto& t) { visit_fields(t, c.hal.laser); });
  v.table("can", [&](auto& t) { visit_fields(t, c.hal.can); });
  v.table("wheel_left", [&](auto& t) { visit_fields(t, c.hal.wheel_left, false); });
  v.table("wheel_right", [&](auto& t) { visit_fields(t, c.hal.wheel_right, false); });
  v.table("turret", [&](auto& t) { visit_fields(t, c.hal.turret, true); });
  v.table("gpio", [&](auto& t) { visit_fields(t, c.hal.gpio); });
  v.table("tilt", [&](auto& t) { visit_fields(t, c.hal.tilt); });
  v.table("estimator", [&](auto& t) { visit_fields(t, c.estimator); });
  v.table("mapping", [&](auto& t) { visit_fields(t, c.mapping); });
  v.table("output", [&](auto& t) { visit_fields(t, c.output); });
  v.table("runtime", [&](auto& t) { visit_fields(t, c.runtime); });
}

}  // namespace rosid::config
