#pragma once
// The laser's physics: what range the electronics report for a beam.

#include <cstdint>
#include <vector>

#include "config/world.hpp"
#include "sim/random.hpp"
#include "sim/scene.hpp"

namespace rosid::sim {

class LaserModel {
 public:
  /// The scene must outlive the model.
  LaserModel(const config::LaserModel& model, const Scene& scene, std::uint64_t seed);

  /// Range for a beam along direction_W (unit), NaN without a return. beam numbers the measurement: it selects the
  /// noise. Not quantised; the range offset of the calibration is not in it.
  ///
  /// The beam is a bundle of sub-rays over its divergence. Returns nearer together than the echo separation merge into
  /// one echo at their power-weighted mean (mixed pixels); the first echo with enough power is reported. Power falls
  /// with reflectivity, the cosine of incidence and the square of the range.
  [[nodiscard]] double measure_m(const Vec3& origin_W, const Vec3& direction_W, std::uint64_t beam) const;

  /// Range bias of a surface, drawn for this run.
  [[nodiscard]] double surface_bias_m(int surface) const { return bias_m_[static_cast<std::size_t>(surface)]; }

 private:
  struct Return {
    double range_m;
    double power;  ///< relative to the power that is just detected
    double cos_incidence;
  };
  struct SubRay {
    double e2;  ///< offset across the beam, rad
    double e3;
    double weight;
  };
  [[nodiscard]] std::vector<SubRay> pattern() const;
  [[nodiscard]] bool is_lost(const Return& echo, std::uint64_t beam) const;

  config::LaserModel model_;
  const Scene* scene_;
  std::vector<double> bias_m_;  ///< by surface id; entry 0 is unused
  std::vector<double> reflectivity_;
  std::vector<SubRay> sub_rays_;
  RandomStream noise_;
  RandomStream dropout_;
};

}  // namespace rosid::sim
