#pragma once
// Single pixels to surfaces.

#include <array>
#include <cstdint>
#include <vector>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {

/// Gives single pixels to the region in or beside their block that explains them best, takes them from regions that do
/// not explain them, block by block from the borders of the regions outwards. Refers to frame, grid and facets of one
/// image; keeps its memory between images.
class PixelAssigner {
 public:
  PixelAssigner(const SegmentFrame& frame, const BlockGrid& grid, const Facets& facets)
      : frame_(frame), grid_(grid), facets_(facets) {}

  /// Before the first assignment of an image.
  void begin() { is_first_ = true; }
  /// The first time all blocks are looked at, later those where pixels have become free or a region is new.
  void assign(std::vector<Region>& regions, Labels& labels);

  /// A region that may own pixels of a block: its plane about the sensor, scaled by the noise there.
  struct Candidate {
    std::int32_t label = kNoLabel;
    float nx = 0.0F;
    float ny = 0.0F;
    float nz = 0.0F;
    float rho = 0.0F;
    const QuickPlane* plane = nullptr;
    bool faces_away = false;  ///< from what is known of the block
  };

 private:
  void find_uniform();
  bool is_interior(int block) const;
  bool needs_visit(int block);
  void enqueue(int block);
  void enqueue_around(int block);
  void look_again(int block);
  bool visit(int block);
  void gather(const PixelBox& box);
  void add_label(std::int32_t label);
  void add_candidate(int block, std::int32_t label);
  void drop_mirages(const PixelBox& box);
  bool is_edge(const PixelBox& box, const Candidate& facet, const Candidate& beyond) const;
  bool assign_block(const PixelBox& box);
  bool assign_to(const PixelBox& box, const Candidate& only);
  std::int32_t decide(std::int32_t own, std::uint32_t best, std::uint32_t second, std::uint32_t mine,
                      const Eigen::Vector3f& point) const;
  void drop_outliers(const PixelBox& box, const Candidate& own);
  int free_pixels(const PixelBox& box) const;

  const SegmentFrame& frame_;
  const BlockGrid& grid_;
  const Facets& facets_;
  std::vector<Region>* regions_ = nullptr;
  Labels* labels_ = nullptr;
  bool is_first_ = true;
  std::vector<int> queue_;
  std::vector<std::uint8_t> visits_;
  std::vector<std::uint8_t> is_queued_;
  std::vector<std::int32_t> uniform_;  ///< label of all pixels of a block, kNoLabel when they differ
  std::vector<int> free_;              ///< usable pixels without label after the last visit
  std::array<std::int32_t, 8> around_{};
  std::size_t around_count_ = 0;
  std::array<Candidate, 8> candidate_{};
  std::size_t candidate_count_ = 0;
};

}  // namespace rosid::mapping
