#include "mapping/segment_runs.hpp"

#include <algorithm>
#include <numeric>

namespace rosid::mapping {

void RunList::find_runs(const SegmentFrame& frame, const Labels& labels) {
  all_.clear();
  label_.clear();
  line_start_.clear();
  const int columns = frame.image().columns;
  for (int i = 0; i < frame.image().lines; ++i) {
    line_start_.push_back(all_.size());
    const std::int32_t* line = labels.data() + frame.image().index(i, 0);
    int j = 0;
    while (j < columns) {
      const std::int32_t label = line[j];
      const int begin = j;
      while (j < columns && line[j] == label) { ++j; }
      if (label == kNoLabel) { continue; }
      all_.push_back({i, begin, j});
      label_.push_back(label);
    }
  }
  line_start_.push_back(all_.size());
}

void RunList::group(std::size_t count) {
  group_.assign(count + 1, 0);
  pixels_.assign(count, 0);
  for (std::size_t r = 0; r < all_.size(); ++r) {
    if (owner_[r] == kNoLabel) { continue; }
    ++group_[static_cast<std::size_t>(owner_[r]) + 1];
    pixels_[static_cast<std::size_t>(owner_[r])] += all_[r].pixels();
  }
  std::partial_sum(group_.begin(), group_.end(), group_.begin());
  run_.resize(group_.back());
  std::vector<std::size_t> next(group_.begin(), group_.end());
  for (std::size_t r = 0; r < all_.size(); ++r) {
    if (owner_[r] != kNoLabel) { run_[next[static_cast<std::size_t>(owner_[r])]++] = all_[r]; }
  }
}

void RunList::from_labels(const SegmentFrame& frame, const Labels& labels, std::size_t count) {
  find_runs(frame, labels);
  owner_ = label_;
  group(count);
  region_of_.resize(count);
  std::iota(region_of_.begin(), region_of_.end(), 0);
}

std::int32_t RunList::root(std::int32_t r) {
  while (owner_[static_cast<std::size_t>(r)] != r) {
    auto& parent = owner_[static_cast<std::size_t>(r)];
    parent = owner_[static_cast<std::size_t>(parent)];
    r = parent;
  }
  return r;
}

void RunList::join(std::size_t a, std::size_t b) {
  if (label_[a] != label_[b]) { return; }
  const std::int32_t top_a = root(static_cast<std::int32_t>(a));
  const std::int32_t top_b = root(static_cast<std::int32_t>(b));
  owner_[static_cast<std::size_t>(std::max(top_a, top_b))] = std::min(top_a, top_b);
}

void RunList::join_lines(const SegmentFrame& frame) {
  for (std::size_t i = 0; i + 1 < static_cast<std::size_t>(frame.image().lines); ++i) {
    std::size_t a = line_start_[i];
    std::size_t b = line_start_[i + 1];
    while (a < line_start_[i + 1] && b < line_start_[i + 2]) {
      if (all_[a].j0 < all_[b].j1 && all_[b].j0 < all_[a].j1) { join(a, b); }
      if (all_[a].j1 < all_[b].j1) {
        ++a;
      } else {
        ++b;
      }
    }
  }
}

void RunList::join_seam(const SegmentFrame& frame) {
  const RasterTopology& topology = frame.topology();
  if (!topology.is_glued()) { return; }
  const int last = topology.lines() - 1;
  for (std::size_t a = line_start_[static_cast<std::size_t>(last)]; a < all_.size(); ++a) {
    // Where the run's ends come to lie; they may have changed places.
    const int begin = topology.at(last + 1, all_[a].j0).j;
    const int end = topology.at(last + 1, all_[a].j1 - 1).j;
    for (std::size_t b = 0; b < line_start_[1]; ++b) {
      if (std::min(begin, end) < all_[b].j1 && all_[b].j0 <= std::max(begin, end)) { join(a, b); }
    }
  }
}

void RunList::from_components(const SegmentFrame& frame, const Labels& labels) {
  find_runs(frame, labels);
  owner_.resize(all_.size());
  std::iota(owner_.begin(), owner_.end(), 0);
  join_lines(frame);
  join_seam(frame);
  // A group's root is its first run.
  std::vector<int> pixels(all_.size(), 0);
  std::vector<std::int32_t> roots;
  for (std::size_t r = 0; r < all_.size(); ++r) {
    const std::int32_t top = root(static_cast<std::int32_t>(r));
    if (top == static_cast<std::int32_t>(r)) { roots.push_back(top); }
    pixels[static_cast<std::size_t>(top)] += all_[r].pixels();
  }
  std::stable_sort(roots.begin(), roots.end(), [&pixels](std::int32_t a, std::int32_t b) {
    return pixels[static_cast<std::size_t>(a)] > pixels[static_cast<std::size_t>(b)];
  });
  std::vector<std::int32_t> number(all_.size(), kNoLabel);
  region_of_.clear();
  for (const std::int32_t top : roots) {
    number[static_cast<std::size_t>(top)] = static_cast<std::int32_t>(region_of_.size());
    region_of_.push_back(label_[static_cast<std::size_t>(top)]);
  }
  for (std::size_t r = 0; r < all_.size(); ++r) {
    const auto top = static_cast<std::size_t>(root(static_cast<std::int32_t>(r)));
    if (top != r) { number[r] = number[top]; }
  }
  owner_ = std::move(number);
  group(region_of_.size());
}

}  // namespace rosid::mapping
