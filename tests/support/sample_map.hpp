#pragma once
// Maps with random but well-formed content, for tests of formats and messages.

#include <cstdint>
#include <random>
#include <vector>

#include "mapping/surface_map.hpp"
#include "msgs/bytes.hpp"
#include "msgs/crc32c.hpp"

namespace rosid::testing {

inline mapping::Ring sample_ring(std::mt19937& random, std::size_t vertices) {
  std::uniform_real_distribution<double> metre(-3.0, 3.0);
  mapping::Ring ring;
  for (std::size_t k = 0; k < vertices; ++k) {
    ring.vertices.emplace_back(metre(random), metre(random));
    ring.edges.push_back(static_cast<mapping::EdgeType>(random() % 5));
  }
  return ring;
}

inline mapping::Patch sample_patch(std::mt19937& random, std::uint32_t id, std::size_t vertices = 5) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  mapping::Patch patch;
  patch.id = id;
  patch.plane.normal = Vec3(unit(random), unit(random), unit(random) + 2.0).normalized();
  tangent_basis(patch.plane.normal, patch.plane.e2, patch.plane.e3);
  patch.plane.centroid = 10.0 * Vec3(unit(random), unit(random), unit(random));
  const Mat3 a = Mat3::NullaryExpr([&] { return 0.01 * unit(random); });
  patch.plane.covariance_independent = a * a.transpose();
  patch.plane.covariance_correlated = 0.5 * a.transpose() * a;
  patch.outer.push_back(sample_ring(random, vertices));
  patch.outer.push_back(sample_ring(random, 3));
  patch.inner.push_back(sample_ring(random, 4));
  mapping::PatchAttributes& attributes = patch.attributes;
  attributes.area_m2 = 1.0 + unit(random);
  attributes.shape_factor = 0.5;
  attributes.elongation_rad = unit(random);
  attributes.curvature_histogram = {0.5F, 0.25F, 0.125F, 0.125F};
  attributes.normal_cone_rad = 0.1;
  attributes.occlusion = 0.3;
  attributes.rms_m = 0.007;
  attributes.pixel_count = static_cast<int>(random() % 1000);
  return patch;
}

inline mapping::SurfaceMap sample_map(unsigned seed, std::uint32_t patches, std::size_t vertices = 5) {
  std::mt19937 random(seed);
  mapping::SurfaceMap map;
  map.version = 17 + seed;
  map.views_fused = 12;
  map.next_id = (3 * patches) + 1;
  map.t = time_from_ns(123'456'789'012);
  map.calibration_hash = 0xFEDCBA9876543210ULL;
  for (std::uint32_t k = 0; k < patches; ++k) {
    mapping::MapPatch entry;
    entry.patch = sample_patch(random, (3 * k) + 1, vertices);
    entry.views = k + 1;
    entry.t_first = time_from_ns(1'000'000LL * k);
    entry.t_last = time_from_ns(2'000'000LL * k);
    entry.existence = 1.5;
    entry.is_floor = k % 3 == 0;
    entry.is_tentative = k % 2 == 0;
    map.patches.push_back(entry);
  }
  return map;
}

/// The first bytes of a map file with a right checksum.
inline std::vector<std::uint8_t> map_header(std::uint32_t version, std::uint64_t calibration_hash) {
  std::vector<std::uint8_t> header{'R', 'O', 'S', 'I', 'M', 'A', 'P', 0x1A};
  msgs::MapWriter out(header);
  out.put(version);
  out.put(calibration_hash);
  out.put(msgs::crc32c(header));
  return header;
}

}  // namespace rosid::testing
