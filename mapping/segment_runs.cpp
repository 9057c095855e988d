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

void RunList::join(std::int32_t a, std::int32_t b) {
  a = root(a);
  b = root(b);
  owner_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
}

void RunList::join_lines(const SegmentFrame& frame, int apart) {
  const auto step = static_cast<std::size_t>(apart);
  for (std::size_t i = 0; i + step < static_cast<std::size_t>(frame.image().lines); ++i) {
    std::size_t a = line_start_[i];
    std::size_t b = line_start_[i + step];
    while (a < line_start_[i + 1] && b < line_start_[i + step + 1]) {
      const bool overlap = all_[a].j0 < all_[b].j1 && all_[b].j0 < all_[a].j1;
      if (overlap) { join_large(a, b); }
      if (all_[a].j1 < all_[b].j1) {
        ++a;
      } else {
        ++b;
      }
    }
  }
}

void RunList::join_over_gaps(const SegmentFrame& frame, const Rule& rule) {
  std::vector<int> pixels(all_.size(), 0);
  for (std::size_t r = 0; r < all_.size(); ++r) {
    pixels[static_cast<std::size_t>(root(static_cast<std::int32_t>(r)))] += all_[r].pixels();
  }
  is_large_.resize(all_.size());
  for (std::size_t r = 0; r < all_.size(); ++r) {
    const int part = pixels[static_cast<std::size_t>(root(static_cast<std::int32_t>(r)))];
    is_large_[r] = part >= rule.min_part ? 1 : 0;
  }
  for (std::size_t a = 0; a < all_.size(); ++a) {
    for (std::size_t b = a + 1; b < all_.size(); ++b) {
      if (all_[b].line != all_[a].line || all_[b].j0 - all_[a].j1 > rule.max_gap) { break; }
      join_large(a, b);
    }
  }
  for (int apart = 2; apart <= rule.max_gap + 1; ++apart) { join_lines(frame, apart); }
}

void RunList::join_large(std::size_t a, std::size_t b) {
  if (label_[a] != label_[b] || is_large_[a] == 0 || is_large_[b] == 0) { return; }
  join(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b));
}

void RunList::join_seam(const SegmentFrame& frame, const Labels& labels) {
  const RasterTopology& topology = frame.topology();
  if (!topology.is_glued()) { return; }
  const int last = topology.lines() - 1;
  for (std::size_t a = line_start_[static_cast<std::size_t>(last)]; a < all_.size(); ++a) {
    for (int j = all_[a].j0; j < all_[a].j1; ++j) {
      const RasterStep step = topology.at(last + 1, j);
      if (!step.is_inside || labels[topology.index(step.i, step.j)] != label_[a]) { continue; }
      // The run of the first line that holds the column.
      const auto begin = all_.begin();
      const auto end = begin + static_cast<std::ptrdiff_t>(line_start_[1]);
      const auto it = std::upper_bound(begin, end, step.j, [](int column, const Run& run) { return column < run.j1; });
      join(static_cast<std::int32_t>(a), static_cast<std::int32_t>(it - begin));
    }
  }
}

void RunList::from_components(const SegmentFrame& frame, const Labels& labels, const Rule& rule) {
  find_runs(frame, labels);
  owner_.resize(all_.size());
  std::iota(owner_.begin(), owner_.end(), 0);
  is_large_.assign(all_.size(), 1);
  join_lines(frame, 1);
  join_seam(frame, labels);
  if (rule.max_gap > 0) { join_over_gaps(frame, rule); }
  struct Component {
    std::int32_t root = 0;
    int pixels = 0;
    int lines = 0;
    int last_line = -1;
  };
  std::vector<Component> components;
  std::vector<std::int32_t> number(all_.size(), kNoLabel);
  for (std::size_t r = 0; r < all_.size(); ++r) {
    const std::int32_t top = root(static_cast<std::int32_t>(r));
    std::int32_t& n = number[static_cast<std::size_t>(top)];
    if (n == kNoLabel) {
      n = static_cast<std::int32_t>(components.size());
      components.push_back({top, 0, 0, -1});
    }
    Component& c = components[static_cast<std::size_t>(n)];
    c.pixels += all_[r].pixels();
    c.lines += c.last_line != all_[r].line ? 1 : 0;
    c.last_line = all_[r].line;
  }
  std::erase_if(components, [&](const Component& c) { return c.pixels < rule.min_pixels || c.lines < rule.min_lines; });
  std::stable_sort(components.begin(), components.end(),
                   [](const Component& a, const Component& b) { return a.pixels > b.pixels; });
  std::fill(number.begin(), number.end(), kNoLabel);
  region_of_.clear();
  for (std::size_t c = 0; c < components.size(); ++c) {
    number[static_cast<std::size_t>(components[c].root)] = static_cast<std::int32_t>(c);
    region_of_.push_back(label_[static_cast<std::size_t>(components[c].root)]);
  }
  std::vector<std::int32_t> group_of(all_.size());
  for (std::size_t r = 0; r < all_.size(); ++r) {
    group_of[r] = number[static_cast<std::size_t>(root(static_cast<std::int32_t>(r)))];
  }
  owner_ = std::move(group_of);
  group(components.size());
}

}  // namespace rosid::mapping
