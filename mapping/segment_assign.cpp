#include "mapping/segment_assign.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace rosid::mapping {
namespace {

constexpr float kJoin = 3.0F;        ///< standard deviations at which a pixel joins a surface
constexpr float kLeave = 3.5F;       ///< ... at which it leaves it again
constexpr float kSurrounded = 5.0F;  ///< ... away from the borders of its surface
constexpr float kBetter = 1.0F;      ///< how much better another surface must explain a pixel
/// A region's number among the candidates, in the last bits of its deviation.
constexpr std::uint32_t kNumberBits = 7;
constexpr std::uint32_t kNobody = 0x7f000000U | kNumberBits;
float deviation_of(std::uint32_t key) {
  return std::bit_cast<float>(key & ~kNumberBits);
}
/// A block is looked at again when its surroundings have changed, but not for ever.
constexpr int kMaxVisits = 4;

/// Distance of a point from a candidate's plane, in standard deviations.
float deviation(const PixelAssigner::Candidate& r, float x, float y, float z) {
  return std::abs((r.nx * x) + (r.ny * y) + (r.nz * z) - r.rho);
}

/// Which of two surfaces that both explain a pixel its ray meets: along a concave edge the nearer one, along a convex
/// edge the farther one. Their planes say so with less noise than the pixel does. Neither when they form no edge.
const PixelAssigner::Candidate* met_by_ray(const PixelAssigner::Candidate& a, const PixelAssigner::Candidate& b,
                                           float x, float y, float z) {
  const bool a_sees_b = a.plane->distance(b.plane->centroid) > 0.0;
  const bool b_sees_a = b.plane->distance(a.plane->centroid) > 0.0;
  if (a_sees_b != b_sees_a) { return nullptr; }
  // Ranges over that of the pixel.
  const float range_a = a.rho / ((a.nx * x) + (a.ny * y) + (a.nz * z));
  const float range_b = b.rho / ((b.nx * x) + (b.ny * y) + (b.nz * z));
  return (range_a < range_b) == a_sees_b ? &a : &b;
}

/// The label all usable pixels of the box have, kNoLabel when they differ or one has none.
std::int32_t uniform_label(const SegmentFrame& frame, const Labels& labels, const PixelBox& box) {
  std::int32_t first = kNoLabel;
  const std::uint8_t* usable = frame.usable().data();
  for (int i = box.i0; i < box.i1; ++i) {
    const std::size_t begin = frame.image().index(i, box.j0);
    const std::int32_t* label = labels.data() + begin;
    for (std::size_t k = 0; k < static_cast<std::size_t>(box.j1 - box.j0); ++k) {
      if (label[k] == first || usable[begin + k] == 0) { continue; }
      if (first != kNoLabel || label[k] == kNoLabel) { return kNoLabel; }
      first = label[k];
    }
  }
  return first;
}

}  // namespace

void PixelAssigner::assign(std::vector<Region>& regions, Labels& labels) {
  regions_ = &regions;
  labels_ = &labels;
  const auto count = static_cast<std::size_t>(grid_.size());
  visits_.assign(count, 0);
  is_queued_.assign(count, 0);
  queue_.clear();
  find_uniform();
  for (int block = 0; block < grid_.size(); ++block) {
    if (needs_visit(block)) { enqueue(block); }
  }
  std::size_t next = 0;
  while (next < queue_.size()) {  // grows on the way
    const int block = queue_[next++];
    is_queued_[static_cast<std::size_t>(block)] = 0;
    if (visit(block)) { enqueue_around(block); }
  }
  for (Region& region : regions) { region.is_new = false; }
  is_first_ = false;
}

bool PixelAssigner::needs_visit(int block) {
  if (!(grid_.moments(block).count > 0.0)) { return false; }
  if (is_first_) { return true; }
  if (is_interior(block)) { return false; }
  const PixelBox box = grid_.box(block);
  if (free_pixels(box) != free_[static_cast<std::size_t>(block)]) { return true; }
  gather(box);
  for (std::size_t c = 0; c < around_count_; ++c) {
    if ((*regions_)[static_cast<std::size_t>(around_[c])].is_new) { return true; }
  }
  return false;
}

void PixelAssigner::enqueue(int block) {
  is_queued_[static_cast<std::size_t>(block)] = 1;
  queue_.push_back(block);
}

void PixelAssigner::find_uniform() {
  uniform_.resize(static_cast<std::size_t>(grid_.size()));
  free_.resize(uniform_.size(), 0);
  for (int block = 0; block < grid_.size(); ++block) {
    uniform_[static_cast<std::size_t>(block)] = uniform_label(frame_, *labels_, grid_.box(block));
  }
}

bool PixelAssigner::is_interior(int block) const {
  const int row = block / grid_.columns();
  const int column = block % grid_.columns();
  if (row == 0 || column == 0 || row + 1 == grid_.rows() || column + 1 == grid_.columns()) { return false; }
  const std::int32_t own = uniform_[static_cast<std::size_t>(block)];
  for (const int r : {row - 1, row, row + 1}) {
    for (const int c : {column - 1, column, column + 1}) {
      if (uniform_[static_cast<std::size_t>(grid_.index(r, c))] != own) { return false; }
    }
  }
  return own != kNoLabel;
}

void PixelAssigner::add_label(std::int32_t label) {
  if (label == kNoLabel || around_count_ == around_.size()) { return; }
  for (std::size_t c = 0; c < around_count_; ++c) {
    if (around_[c] == label) { return; }
  }
  around_[around_count_++] = label;
}

/// Labels of the block's pixels and of those that touch it.
void PixelAssigner::gather(const PixelBox& box) {
  around_count_ = 0;
  std::int32_t last = kNoLabel;
  const auto see = [&](std::int32_t label) {
    if (label == last) { return; }
    last = label;
    add_label(label);
  };
  const RasterTopology& topology = frame_.topology();
  const bool is_inner = box.i0 > 0 && box.i1 < topology.lines() && box.j0 > 0 && box.j1 < topology.columns();
  if (is_inner) {
    for (int i = box.i0 - 1; i <= box.i1; ++i) {
      const std::int32_t* line = labels_->data() + topology.index(i, box.j0 - 1);
      for (int j = 0; j < box.j1 - box.j0 + 2; ++j) { see(line[j]); }
    }
  } else {
    for (int i = box.i0 - 1; i <= box.i1; ++i) {
      for (int j = box.j0 - 1; j <= box.j1; ++j) {
        const RasterStep step = topology.at(i, j);
        if (!step.is_inside) { continue; }
        see((*labels_)[topology.index(step.i, step.j)]);
      }
    }
  }
}

void PixelAssigner::add_candidate(int block, std::int32_t label) {
  const Region& region = (*regions_)[static_cast<std::size_t>(label)];
  if (!region.is_alive) { return; }
  // A facet whose region has been dissolved knows nothing.
  const std::int32_t facet = facets_.of_block[static_cast<std::size_t>(block)];
  const bool is_live = facet != kNoLabel && (*labels_)[grid_.typical_pixel(block)] != kNoLabel;
  const bool is_away = is_live && faces_away(facets_.facets[static_cast<std::size_t>(facet)], region.plane.normal);
  const Moments& points = grid_.moments(block);
  const Vec3& n = region.plane.normal;
  const Vec3& mean = grid_.mean(block);
  // No point of a sample is farther from its mean than sqrt(count - 1) standard deviations.
  const double spread = std::max(0.0, n.dot(points.products() * n) - (points.count * n.dot(mean) * n.dot(mean)));
  const double nearest = std::abs(region.plane.distance(mean)) - std::sqrt(spread);
  const double reach =
      static_cast<double>(kLeave) * std::sqrt(frame_.variance_bound(mean.norm()) + frame_.flatness_variance());
  if (nearest > reach) { return; }
  const SegmentFrame::Variance v = frame_.variance(grid_.noise(block), n);
  const double scale = 1.0 / std::sqrt(v.total() + frame_.flatness_variance());
  const Vec3 scaled = scale * n;
  candidate_[candidate_count_++] = {label,
                                    static_cast<float>(scaled.x()),
                                    static_cast<float>(scaled.y()),
                                    static_cast<float>(scaled.z()),
                                    static_cast<float>(scaled.dot(region.plane.centroid)),
                                    &region.plane,
                                    is_away};
}

std::int32_t PixelAssigner::decide(std::int32_t own, std::uint32_t best, std::uint32_t second, std::uint32_t mine,
                                   const Eigen::Vector3f& point) const {
  const float best_deviation = deviation_of(best);
  const float own_deviation = deviation_of(mine);
  if (best_deviation <= kJoin) {
    const Candidate& first = candidate_[best & kNumberBits];
    const bool is_alone = !(deviation_of(second) <= kJoin);
    const Candidate& other = is_alone ? first : candidate_[second & kNumberBits];
    // A surface that faces another way than the block gets no more of it than what lies beyond their common edge.
    const bool may_join = !first.faces_away || (own != kNoLabel && other.label == own);
    if (is_alone) { return may_join ? first.label : (own_deviation <= kLeave ? own : kNoLabel); }
    const bool may_meet = may_join && (!other.faces_away || first.label == own);
    const Candidate* met = may_meet ? met_by_ray(first, other, point.x(), point.y(), point.z()) : nullptr;
    if (met != nullptr) { return met->label; }
    if (!first.faces_away && best_deviation + kBetter < own_deviation) { return first.label; }
  }
  return own_deviation <= kLeave ? own : kNoLabel;
}

bool PixelAssigner::assign_block(const PixelBox& box) {
  const float* x = frame_.x().data();
  const float* y = frame_.y().data();
  const float* z = frame_.z().data();
  bool changed = false;
  for_each_pixel(frame_, box, [&](std::size_t k) {
    if (!frame_.is_usable(k)) { return; }
    const std::int32_t own = (*labels_)[k];
    // Deviations as integers that carry the candidate's number in their last bits: positive floats sort like
    // integers, and the two smallest are found without a branch.
    std::uint32_t best = kNobody;
    std::uint32_t second = kNobody;
    std::uint32_t mine = kNobody;
    for (std::uint32_t c = 0; c < candidate_count_; ++c) {
      const Candidate& r = candidate_[c];
      const float distance = deviation(r, x[k], y[k], z[k]);
      const std::uint32_t key = (std::bit_cast<std::uint32_t>(distance) & ~kNumberBits) | c;
      mine = r.label == own ? key : mine;
      second = std::min(second, std::max(best, key));
      best = std::min(best, key);
    }
    const std::int32_t now = decide(own, best, second, mine, Eigen::Vector3f(x[k], y[k], z[k]));
    changed = changed || now != own;
    (*labels_)[k] = now;
  });
  return changed;
}

bool PixelAssigner::visit(int block) {
  const bool is_inside = is_first_ && visits_[static_cast<std::size_t>(block)] == 0 && is_interior(block);
  ++visits_[static_cast<std::size_t>(block)];
  const PixelBox box = grid_.box(block);
  candidate_count_ = 0;
  if (is_inside) {
    add_candidate(block, uniform_[static_cast<std::size_t>(block)]);
    if (candidate_count_ == 1) { drop_outliers(box, candidate_[0]); }
    free_[static_cast<std::size_t>(block)] = free_pixels(box);
    return false;
  }
  gather(box);
  for (std::size_t c = 0; c < around_count_; ++c) { add_candidate(block, around_[c]); }
  drop_mirages(box);
  const bool changed = candidate_count_ == 1 && !candidate_[0].faces_away ? assign_to(box, candidate_[0])
                                                                          : candidate_count_ > 0 && assign_block(box);
  free_[static_cast<std::size_t>(block)] = free_pixels(box);
  return changed;
}

/// A plane continued beyond its surface cuts through others. A true edge differs from such a line in what lies beyond
/// it: pixels that fit the plane, not the surface the line is drawn on.
void PixelAssigner::drop_mirages(const PixelBox& box) {
  const auto is_own = [](const Candidate& r) { return !r.faces_away; };
  const auto own = std::find_if(candidate_.begin(), candidate_.begin() + candidate_count_, is_own);
  const Candidate* facet = own == candidate_.begin() + candidate_count_ ? nullptr : &*own;
  std::size_t kept = 0;
  for (std::size_t c = 0; c < candidate_count_; ++c) {
    const bool is_real = !candidate_[c].faces_away || (facet != nullptr && is_edge(box, *facet, candidate_[c]));
    if (!is_real) { continue; }
    std::swap(candidate_[kept], candidate_[c]);
    ++kept;
  }
  candidate_count_ = kept;
}

bool PixelAssigner::is_edge(const PixelBox& box, const Candidate& facet, const Candidate& beyond) const {
  constexpr float kLimit = 4.0F;  // lest single pixels decide
  const float* x = frame_.x().data();
  const float* y = frame_.y().data();
  const float* z = frame_.z().data();
  float gain = 0.0F;
  for_each_pixel(frame_, box, [&](std::size_t k) {
    if (!frame_.is_usable(k) || met_by_ray(facet, beyond, x[k], y[k], z[k]) != &beyond) { return; }
    gain +=
        std::min(deviation(facet, x[k], y[k], z[k]), kLimit) - std::min(deviation(beyond, x[k], y[k], z[k]), kLimit);
  });
  return gain > 0.0F;
}

bool PixelAssigner::assign_to(const PixelBox& box, const Candidate& only) {
  const float* x = frame_.x().data();
  const float* y = frame_.y().data();
  const float* z = frame_.z().data();
  const std::uint8_t* usable = frame_.usable().data();
  std::int32_t* labels = labels_->data();
  bool changed = false;
  for_each_pixel(frame_, box, [&](std::size_t k) {
    const float limit = labels[k] == only.label ? kLeave : kJoin;
    const std::int32_t now = usable[k] != 0 && deviation(only, x[k], y[k], z[k]) <= limit ? only.label : kNoLabel;
    changed = changed || now != labels[k];
    labels[k] = now;
  });
  return changed;
}

void PixelAssigner::drop_outliers(const PixelBox& box, const Candidate& own) {
  const float* x = frame_.x().data();
  const float* y = frame_.y().data();
  const float* z = frame_.z().data();
  for_each_pixel(frame_, box, [&](std::size_t k) {
    // Pixels that are not usable lie far from any surface, at the sensor.
    if (deviation(own, x[k], y[k], z[k]) > kSurrounded) { (*labels_)[k] = kNoLabel; }
  });
}

int PixelAssigner::free_pixels(const PixelBox& box) const {
  int count = 0;
  for_each_pixel(frame_, box,
                 [&](std::size_t k) { count += (*labels_)[k] == kNoLabel && frame_.is_usable(k) ? 1 : 0; });
  return count;
}

void PixelAssigner::look_again(int block) {
  const auto n = static_cast<std::size_t>(block);
  if (is_queued_[n] != 0 || free_[n] == 0 || visits_[n] >= kMaxVisits) { return; }
  enqueue(block);
}

void PixelAssigner::enqueue_around(int block) {
  const int row = block / grid_.columns();
  const int column = block % grid_.columns();
  if (row > 0 && row + 1 < grid_.rows() && column > 0 && column + 1 < grid_.columns()) {
    for (const int r : {block - grid_.columns(), block, block + grid_.columns()}) {
      look_again(r - 1);
      look_again(r + 1);
      if (r != block) { look_again(r); }
    }
    return;
  }
  const PixelBox box = grid_.box(block);
  const RasterTopology& topology = frame_.topology();
  for (const int i : {box.i0 - 1, box.i0, box.i1}) {
    for (const int j : {box.j0 - 1, box.j0, box.j1}) {
      const RasterStep step = topology.at(i, j);
      if (!step.is_inside) { continue; }
      const int next = grid_.index(step.i / grid_.height(), step.j / grid_.width());
      if (next != block) { look_again(next); }
    }
  }
}

void refit(const SegmentFrame& frame, const BlockGrid& grid, std::vector<Region>& regions, const Labels& labels) {
  std::vector<double> before;
  before.reserve(regions.size());
  for (Region& region : regions) {
    before.push_back(region.moments.count);
    region.moments = Moments{};
  }
  for (int block = 0; block < grid.size(); ++block) {
    if (!(grid.moments(block).count > 0.0)) { continue; }
    const PixelBox box = grid.box(block);
    const std::int32_t first = uniform_label(frame, labels, box);
    if (first != kNoLabel) {
      regions[static_cast<std::size_t>(first)].moments += grid.moments(block);
      continue;
    }
    for_each_pixel(frame, box, [&](std::size_t k) {
      if (labels[k] != kNoLabel) { regions[static_cast<std::size_t>(labels[k])].moments.add(frame.point(k)); }
    });
  }
  for (std::size_t r = 0; r < regions.size(); ++r) {
    Region& region = regions[r];
    region.is_alive = region.is_alive && region.moments.count >= 3.0;
    if (region.is_alive) { region.plane = fit_quick(region.moments); }
    constexpr double kMuch = 0.1;
    region.is_new = region.is_new || std::abs(region.moments.count - before[r]) > kMuch * before[r];
  }
}

}  // namespace rosid::mapping
