#include "mapping/config.hpp"

#include <cmath>

#include "base/units.hpp"

namespace rosid::mapping {
namespace {

/// Collects one sentence for each broken rule.
class Rules {
 public:
  void require(bool holds, const char* sentence) {
    if (!holds) { problems_.emplace_back(sentence); }
  }
  std::vector<std::string> take() { return std::move(problems_); }

 private:
  std::vector<std::string> problems_;
};

void check(const AssemblerConfig& config, Rules& rules) {
  rules.require(config.opening_rad >= rad_from_deg(5.0) && config.opening_rad <= kPi,
                "'opening' must be between 5 and 180 degrees");
  rules.require(config.range_min_m >= 0.0, "'range_min_m' must be zero or more");
  rules.require(config.range_max_m > config.range_min_m && config.range_max_m <= 1000.0,
                "'range_max_m' must be greater than 'range_min_m' and at most 1000");
  rules.require(config.seam_rad >= 0.0 && config.seam_rad <= kPi, "'seam' must be between 0 and 180 degrees");
  rules.require(config.max_lines >= 20 && config.max_lines <= 2000, "'max_lines' must be between 20 and 2000");
}

void check(const SegmenterConfig& config, Rules& rules) {
  rules.require(config.min_patch_pixels >= 4, "'min_patch_pixels' must be at least 4");
  rules.require(config.min_patch_area_m2 >= 0.0 && config.min_patch_area_m2 < 100.0,
                "'min_patch_area_m2' must be zero or more and below 100");
  rules.require(config.min_patch_lines >= 1, "'min_patch_lines' must be at least 1");
  rules.require(config.merge_angle_max_rad > 0.0 && config.merge_angle_max_rad < 0.5 * kPi,
                "'merge_angle_max' must be greater than 0 and below 90 degrees");
}

void check(const MatcherConfig& config, Rules& rules) {
  rules.require(config.gate_probability > 0.5 && config.gate_probability < 1.0,
                "'gate_probability' must be greater than 0.5 and below 1");
  rules.require(config.min_pairs >= 1, "'min_pairs' must be at least 1");
  rules.require(config.max_iterations >= 1 && config.max_iterations <= 100,
                "'max_iterations' must be between 1 and 100");
}

void check(const FusionConfig& config, Rules& rules) {
  rules.require(config.snap_distance_m > 0.0 && config.snap_distance_m <= 1.0,
                "'snap_distance_m' must be greater than 0 and at most 1");
  rules.require(config.max_patches >= 1 && config.max_patches <= 100000, "'max_patches' must be between 1 and 100000");
  rules.require(config.max_ring_vertices >= 4, "'max_ring_vertices' must be at least 4");
  rules.require(config.min_confidence >= 0.0 && config.min_confidence <= 1.0,
                "'min_confidence' must be between 0 and 1");
}

}  // namespace

std::vector<std::string> validate(const MappingConfig& config) {
  Rules rules;
  check(config.assembler, rules);
  check(config.segmenter, rules);
  check(config.matcher, rules);
  check(config.fusion, rules);
  return rules.take();
}

}  // namespace rosid::mapping
