#pragma once
// The order in which edges happened.

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "hal/turret/edge.hpp"

namespace rosid::hal {

/// Calls handle(EdgeRecord) for the edges of one read, neighbours in order of their sequence numbers. The kernel
/// numbers an edge in the interrupt, but queues it from a thread of the line's own: of two lines that change together
/// the later edge may be queued first. Only edges that stand within four places of each other change places, so that
/// nonsense stays as it came. Edges that were swapped across two reads are not put right. No allocation.
template <typename Handle>
void for_each_in_sequence(std::span<const EdgeRecord> edges, const Handle& handle) {
  constexpr std::size_t kBatch = 64;
  constexpr std::size_t kMostPlaces = 4;
  std::array<EdgeRecord, kBatch> batch;
  while (!edges.empty()) {
    const std::size_t size = std::min(edges.size(), kBatch);
    std::copy_n(edges.begin(), size, batch.begin());
    for (std::size_t k = 1; k < size; ++k) {
      for (std::size_t j = k; j > 0 && k - j < kMostPlaces; --j) {
        const std::uint32_t ahead = batch[j - 1].sequence - batch[j].sequence;  // wraps, as the numbers do
        if (ahead == 0 || ahead > kMostPlaces) { break; }
        std::swap(batch[j - 1], batch[j]);
      }
    }
    for (std::size_t k = 0; k < size; ++k) { handle(batch[k]); }
    edges = edges.subspan(size);
  }
}

}  // namespace rosid::hal
