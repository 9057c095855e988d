// Boolean operations on a raster: the last resort of combine(), slow and coarse but unable to fail.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "mapping/polygon.hpp"

namespace rosid::mapping {
namespace {

constexpr double kMaxCells = 1e6;

/// Cells with a border of one empty cell all round.
struct Raster {
  std::int64_t x0 = 0;    ///< grid coordinate of the left edge of column 0
  std::int64_t y0 = 0;    ///< grid coordinate of the lower edge of row 0
  std::int64_t cell = 1;  ///< grid units
  std::size_t columns = 0;
  std::size_t rows = 0;
  std::vector<bool> is_set;

  std::size_t index(std::size_t column, std::size_t row) const { return row * columns + column; }
};

Raster make_raster(const PolygonSet& a, const PolygonSet& b, double cell_m) {
  std::int64_t x_min = std::numeric_limits<std::int64_t>::max();
  std::int64_t x_max = std::numeric_limits<std::int64_t>::min();
  std::int64_t y_min = x_min;
  std::int64_t y_max = x_max;
  for (const PolygonSet* set : {&a, &b}) {
    for (const GridRing& ring : set->rings()) {
      for (const GridPoint& p : ring) {
        x_min = std::min(x_min, p.x);
        x_max = std::max(x_max, p.x);
        y_min = std::min(y_min, p.y);
        y_max = std::max(y_max, p.y);
      }
    }
  }
  Raster raster;
  if (x_min > x_max) { return raster; }
  const double area = static_cast<double>(x_max - x_min) * static_cast<double>(y_max - y_min);
  const double cell = std::max(cell_m / kGrid_m, std::sqrt(area / kMaxCells));
  raster.cell = std::max<std::int64_t>(1, std::llround(std::ceil(cell)));
  raster.x0 = x_min - raster.cell;
  raster.y0 = y_min - raster.cell;
  raster.columns = static_cast<std::size_t>((x_max - x_min) / raster.cell + 3);
  raster.rows = static_cast<std::size_t>((y_max - y_min) / raster.cell + 3);
  return raster;
}

/// Sets the cells whose centres lie inside, row by row (even-odd).
std::vector<bool> fill(const PolygonSet& set, const Raster& raster) {
  std::vector<bool> is_set(raster.columns * raster.rows, false);
  std::vector<double> crossings;
  const auto cell = static_cast<double>(raster.cell);
  for (std::size_t row = 0; row < raster.rows; ++row) {
    const double y = static_cast<double>(raster.y0) + (static_cast<double>(row) + 0.5) * cell;
    crossings.clear();
    for (const GridRing& ring : set.rings()) {
      for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
        const auto yi = static_cast<double>(ring[i].y);
        const auto yj = static_cast<double>(ring[j].y);
        if ((yi > y) == (yj > y)) { continue; }
        const auto xi = static_cast<double>(ring[i].x);
        crossings.push_back(xi + (y - yi) / (yj - yi) * (static_cast<double>(ring[j].x) - xi));
      }
    }
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t k = 0; k + 1 < crossings.size(); k += 2) {
      const double left = (crossings[k] - static_cast<double>(raster.x0)) / cell - 0.5;
      const double right = (crossings[k + 1] - static_cast<double>(raster.x0)) / cell - 0.5;
      const auto first = static_cast<std::int64_t>(std::ceil(left));
      const auto last = static_cast<std::int64_t>(std::floor(right));
      for (std::int64_t column = first; column <= last; ++column) {
        is_set[raster.index(static_cast<std::size_t>(column), row)] = true;
      }
    }
  }
  return is_set;
}

/// Border edges of the set cells, one bit per direction of travel (0 right, 1 up, 2 left, 3 down), set side on the
/// left.
std::vector<std::uint8_t> border_edges(const Raster& raster) {
  std::vector<std::uint8_t> edges((raster.columns + 1) * (raster.rows + 1), 0);
  const auto add = [&](std::size_t x, std::size_t y, unsigned direction) {
    std::uint8_t& bits = edges[y * (raster.columns + 1) + x];
    bits = static_cast<std::uint8_t>(bits | (1U << direction));
  };
  for (std::size_t y = 1; y + 1 < raster.rows; ++y) {
    for (std::size_t x = 1; x + 1 < raster.columns; ++x) {
      if (!raster.is_set[raster.index(x, y)]) { continue; }
      if (!raster.is_set[raster.index(x, y - 1)]) { add(x, y, 0); }
      if (!raster.is_set[raster.index(x + 1, y)]) { add(x + 1, y, 1); }
      if (!raster.is_set[raster.index(x, y + 1)]) { add(x + 1, y + 1, 2); }
      if (!raster.is_set[raster.index(x - 1, y)]) { add(x, y + 1, 3); }
    }
  }
  return edges;
}

/// Follows one border from vertex `start`, taking its edges away. Left turns first: cells that touch in a corner only
/// get rings of their own.
GridRing follow(std::vector<std::uint8_t>& edges, const Raster& raster, std::size_t start, unsigned direction) {
  const std::size_t stride = raster.columns + 1;
  GridRing ring;
  std::size_t at = start;
  unsigned last_direction = 4;
  for (;;) {
    if (direction != last_direction) {
      ring.push_back({raster.x0 + raster.cell * static_cast<std::int64_t>(at % stride),
                      raster.y0 + raster.cell * static_cast<std::int64_t>(at / stride)});
    }
    edges[at] = static_cast<std::uint8_t>(edges[at] & ~(1U << direction));
    last_direction = direction;
    switch (direction) {
      case 0: at += 1; break;
      case 1: at += stride; break;
      case 2: at -= 1; break;
      default: at -= stride; break;
    }
    if (at == start) { return ring; }
    for (const unsigned turn : std::array<unsigned, 3>{1, 0, 3}) {
      const unsigned next = (direction + turn) % 4;
      if ((edges[at] & (1U << next)) != 0) {
        direction = next;
        break;
      }
    }
  }
}

}  // namespace

PolygonSet raster_combine(const PolygonSet& a, const PolygonSet& b, BooleanOp op, double cell_m) {
  Raster raster = make_raster(a, b, cell_m);
  if (raster.columns == 0) { return {}; }
  raster.is_set = fill(a, raster);
  const std::vector<bool> in_b = fill(b, raster);
  for (std::size_t k = 0; k < in_b.size(); ++k) {
    switch (op) {
      case BooleanOp::Union: raster.is_set[k] = raster.is_set[k] || in_b[k]; break;
      case BooleanOp::Intersection: raster.is_set[k] = raster.is_set[k] && in_b[k]; break;
      case BooleanOp::Difference: raster.is_set[k] = raster.is_set[k] && !in_b[k]; break;
    }
  }
  std::vector<std::uint8_t> edges = border_edges(raster);
  std::vector<GridRing> rings;
  for (std::size_t vertex = 0; vertex < edges.size(); ++vertex) {
    for (unsigned direction = 0; direction < 4; ++direction) {
      if ((edges[vertex] & (1U << direction)) != 0) { rings.push_back(follow(edges, raster, vertex, direction)); }
    }
  }
  return PolygonSet::from_grid(std::move(rings));
}

}  // namespace rosid::mapping
