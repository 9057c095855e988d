#pragma once
// Settings of the mapping library. SI units; every member has a default that works.

#include <string>
#include <vector>

namespace rosid::mapping {

struct AssemblerConfig {
  double opening_rad = 1.7453292519943295;  ///< field of view of a line, symmetric about the optical axis (100 degrees)
  double range_min_m = 0.30;
  double range_max_m = 30.0;
  /// Turret angle at which an image begins. At the seam pixels side by side are a whole image apart in time. A
  /// horizontal scan plane (0): the last lines, which the fix refers to, see the walls, and the walls tell the heading.
  double seam_rad = 0.0;
  int max_lines = 2000;  ///< of one half turn; a slower turret closes the image early
};

struct SegmenterConfig {
  int min_patch_pixels = 20;
  double min_patch_area_m2 = 0.02;
  int min_patch_lines = 3;
  double merge_angle_max_rad = 0.17;  ///< 10 degrees
};

struct MatcherConfig {
  double gate_probability = 0.99;  ///< chi-square gate of a pair in tracking
  int min_pairs = 2;
  int max_iterations = 10;
};

struct FusionConfig {
  double snap_distance_m = 0.05;  ///< boundary tolerance tau_H
  int max_patches = 400;
  int max_ring_vertices = 64;
  double min_confidence = 0.2;
};

struct MappingConfig {
  AssemblerConfig assembler;
  SegmenterConfig segmenter;
  MatcherConfig matcher;
  FusionConfig fusion;
};

/// Every rule the values break, one sentence each, named by key; empty when usable.
std::vector<std::string> validate(const MappingConfig& config);

}  // namespace rosid::mapping
