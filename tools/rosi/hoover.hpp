#pragma once
// Region scores after Hoover et al. 1996: what a segmentation found of the true regions [maths 5.8].

#include <cstdint>
#include <span>
#include <vector>

namespace rosid::rosi {

/// True regions of an image. A surface that something in front of it cuts apart is seen as several regions.
struct TruthRegions {
  std::vector<std::uint32_t> region;      ///< of each pixel, from 1; 0: no region
  std::vector<std::uint32_t> surface_of;  ///< surface of each region; [0] is not used
};

/// Every label is a region and a surface of its own.
TruthRegions regions_from_labels(std::span<const std::uint16_t> labels);

/// A true and a machine region that share pixels.
struct RegionPair {
  std::uint32_t truth = 0;
  std::uint16_t machine = 0;
  double weight = 0.0;          ///< of the pixels they share
  double surface_weight = 0.0;  ///< of the pixels the machine region shares with all regions of the same surface
};

/// Which regions overlap and by how much: counted once, judged at as many tolerances as one likes.
struct RegionOverlap {
  struct Region {
    int pixels = 0;
    double weight = 0.0;
  };
  std::vector<Region> truth;              ///< by region, [0] is not used
  std::vector<Region> machine;            ///< by label, [0] is not used; labels without a pixel have no pixels
  std::vector<std::uint32_t> surface_of;  ///< of each true region
  std::vector<RegionPair> pairs;          ///< in order of (truth, machine)
};

/// Machine label 0 is no region. `weight` holds what each pixel counts; pixels that weigh nothing are left out
/// altogether. Empty: each counts 1. Precondition: all have the same size. O(N log pairs).
RegionOverlap overlap_regions(std::span<const std::uint16_t> machine, const TruthRegions& truth,
                              std::span<const double> weight = {});

struct HooverOptions {
  double tolerance = 0.8;  ///< T, in (0.5, 1): above one half no region can be correct twice
  int min_pixels = 100;    ///< true regions must have more than these to be counted
};

/// What became of a counted true region.
enum class Outcome : std::uint8_t { NotCounted, Correct, OverSegmented, UnderSegmented, Missed };

/// Each counted true region is exactly one of correct, over-segmented, under-segmented and missed; in that order where
/// it could be several. Small true regions are not counted, but what is found on them is no noise.
struct HooverScore {
  int truth_regions = 0;    ///< counted ones
  int machine_regions = 0;  ///< all
  int correct = 0;          ///< one machine region has T of it and lies on its surface with T of itself
  int over_segmented = 0;   ///< two or more, each on its surface with T of itself, have T of it together
  int under_segmented = 0;  ///< T of it is in a machine region that holds T of regions of other surfaces as well
  int missed = 0;
  int noise = 0;      ///< machine regions that take part in none of these
  int fragments = 0;  ///< machine regions beside the correct one on a correct true region, with T of themselves
  std::vector<Outcome> outcome;           ///< of each true region
  std::vector<RegionPair> correct_pairs;  ///< of counted regions, in order of truth
};

/// Precondition: tolerance in (0.5, 1).
HooverScore score_regions(const RegionOverlap& overlap, const HooverOptions& options);

}  // namespace rosid::rosi
