#include "mapping/boundary.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace rosid::mapping {
namespace {

/// Rays that meet a plane under less than this sine say nothing about where.
constexpr double kGrazing = 0.0523;  // 3 degrees
/// How far a boundary looks outwards for the next surface: mixed pixels lie between.
constexpr int kReach = 3;
constexpr double kSteepest = 5.7;  ///< cotangent of 10 degrees

double cotangent_of_incidence(const Plane& plane, const Vec3& direction) {
  const double s = std::abs(plane.normal.dot(direction));
  return s < 1e-6 ? kSteepest : std::min(kSteepest, std::sqrt(std::max(0.0, 1.0 - (s * s))) / s);
}

}  // namespace

bool BoundaryTracer::is_inside(int i, int j) const {
  if (i >= 0 && i < frame_.image().lines && j >= 0 && j < frame_.image().columns) {
    return labels_[frame_.topology().index(i, j)] == label_;
  }
  const RasterStep step = frame_.topology().at(i, j);
  return step.is_inside && labels_[frame_.topology().index(step.i, step.j)] == label_;
}

BoundaryTracer::State BoundaryTracer::next(const State& s) const {
  // Along the crack, region on one hand: the heading is the outward side turned by a quarter.
  const int ahead_i = -s.side_j * s.handed;
  const int ahead_j = s.side_i * s.handed;
  if (!is_inside(s.i + ahead_i, s.j + ahead_j)) { return {s.i, s.j, ahead_i, ahead_j, s.handed}; }
  int i = s.i + ahead_i;
  int j = s.j + ahead_j;
  State result{i, j, s.side_i, s.side_j, s.handed};
  if (is_inside(i + s.side_i, j + s.side_j)) {
    i += s.side_i;
    j += s.side_j;
    result = {i, j, -ahead_i, -ahead_j, s.handed};
  }
  const RasterStep step = frame_.topology().at(i, j);
  result.i = step.i;
  result.j = step.j;
  if (step.flipped) {
    result.side_j = -result.side_j;
    result.handed = -result.handed;
  }
  return result;
}

BoundaryTracer::Ray BoundaryTracer::ray(int i, int j) const {
  const RangeImage& image = frame_.image();
  const RasterStep step = frame_.topology().at(i, j);
  const int line = std::clamp(step.i, 0, image.lines - 1);
  const int column = std::clamp(step.j, 0, image.columns - 1);
  Ray result;
  result.origin = image.line[static_cast<std::size_t>(line)].origin_V;
  const auto direction = [&image](int a, int b) -> Vec3 {
    return image.direction_V[image.index(std::clamp(a, 0, image.lines - 1), std::clamp(b, 0, image.columns - 1))]
        .cast<double>();
  };
  result.direction = direction(line, column);
  // One step outside the raster: continue the rays linearly.
  if (column != step.j) { result.direction += result.direction - direction(line, (2 * column) - step.j); }
  if (line != step.i) { result.direction += result.direction - direction((2 * line) - step.i, column); }
  return result;
}

double BoundaryTracer::range_to(const Plane& plane, const Ray& ray) {
  const double cosine = plane.normal.dot(ray.direction);
  if (cosine > -kGrazing) { return -1.0; }
  return plane.normal.dot(plane.centroid - ray.origin) / cosine;
}

BoundaryTracer::Ray BoundaryTracer::corner_ray(const State& s, int ahead_i, int ahead_j) const {
  const RangeImage& image = frame_.image();
  const int far_i = s.i + s.side_i + ahead_i;
  const int far_j = s.j + s.side_j + ahead_j;
  Ray mean;
  if (far_i >= 0 && far_i < image.lines && far_j >= 0 && far_j < image.columns) {
    // All four pixels around the corner lie on the raster.
    const std::size_t far = image.index(far_i, far_j);
    const Eigen::Vector3f sum = image.direction_V[image.index(s.i, s.j)] +
                                image.direction_V[image.index(s.i + s.side_i, s.j + s.side_j)] +
                                image.direction_V[image.index(s.i + ahead_i, s.j + ahead_j)] + image.direction_V[far];
    mean.direction = sum.cast<double>();
    mean.origin = 0.5 * (image.line[static_cast<std::size_t>(s.i)].origin_V +
                         image.line[static_cast<std::size_t>(far_i)].origin_V);
  } else {
    for (const Ray& r :
         {ray(s.i, s.j), ray(s.i + s.side_i, s.j + s.side_j), ray(s.i + ahead_i, s.j + ahead_j), ray(far_i, far_j)}) {
      mean.origin += 0.25 * r.origin;
      mean.direction += r.direction;
    }
  }
  mean.direction.normalize();
  return mean;
}

Vec2 BoundaryTracer::corner(const State& s) const {
  const Plane& plane = planes_[static_cast<std::size_t>(label_)];
  const int ahead_i = -s.side_j * s.handed;
  const int ahead_j = s.side_i * s.handed;
  const std::size_t k = frame_.topology().index(s.i, s.j);
  const Ray own_ray{frame_.image().line[static_cast<std::size_t>(s.i)].origin_V, frame_.direction(k)};
  const Ray mean = corner_ray(s, ahead_i, ahead_j);
  const double own_range = range_to(plane, own_ray);
  const Vec3 own = own_range > 0.0
                       ? Vec3(own_ray.origin + own_range * own_ray.direction)
                       : (frame_.is_valid(k) ? Vec3(frame_.point(k) + frame_.image().sensor_V) : plane.centroid);
  Vec2 own_2d = plane.to_plane(own);
  const double range = range_to(plane, mean);
  if (range <= 0.0 || !std::isfinite(range)) { return own_2d; }
  Vec2 corner_2d = plane.to_plane(mean.origin + range * mean.direction);
  // Where the region meets itself at a corner only, the two passages keep a little apart.
  constexpr double kApart = 0.1;
  const bool is_pinched =
      !is_inside(s.i + ahead_i, s.j + ahead_j) && is_inside(s.i + s.side_i + ahead_i, s.j + s.side_j + ahead_j);
  if (is_pinched) { corner_2d += kApart * (own_2d - corner_2d); }
  // Near the plane's horizon half a pixel reaches very far: no farther than this surface is seen to go on.
  const double angle2 = (mean.direction - own_ray.direction).squaredNorm();
  const double incidence = std::max(-plane.normal.dot(own_ray.direction), 2.0 * kGrazing);
  const double shift = (mean.origin - own_ray.origin).norm();
  const double limit = ((1.5 * std::sqrt(angle2 * (own - own_ray.origin).squaredNorm())) + shift) / incidence;
  const double distance = (corner_2d - own_2d).norm();
  return distance > limit ? Vec2(own_2d + (limit / distance) * (corner_2d - own_2d)) : corner_2d;
}

BoundaryTracer::Beyond BoundaryTracer::look_beyond(const State& s) const {
  const RasterTopology& topology = frame_.topology();
  std::size_t first_valid = 0;
  int steps_to_valid = 0;
  Beyond result;
  for (int step = 1; step <= kReach; ++step) {
    const RasterStep to = topology.at(s.i + (step * s.side_i), s.j + (step * s.side_j));
    if (!to.is_inside) {
      if (steps_to_valid == 0) { result.type = EdgeType::FieldOfView; }
      break;
    }
    const std::size_t k = topology.index(to.i, to.j);
    if (labels_[k] == label_) { break; }
    if (labels_[k] != kNoLabel) { return compare(s, step, k); }
    if (steps_to_valid == 0 && frame_.is_valid(k)) {
      steps_to_valid = step;
      first_valid = k;
    }
  }
  return steps_to_valid > 0 ? compare(s, steps_to_valid, first_valid) : result;
}

BoundaryTracer::Beyond BoundaryTracer::compare(const State& s, int steps, std::size_t other) const {
  const Plane& plane = planes_[static_cast<std::size_t>(label_)];
  const Ray here = ray(s.i, s.j);
  Ray there;
  there.origin = frame_.image().line[static_cast<std::size_t>(frame_.line_of(other))].origin_V;
  there.direction = frame_.direction(other);
  Beyond result;
  result.neighbour = labels_[other];
  const double range_there = (frame_.point(other) + frame_.image().sensor_V - there.origin).norm();
  const double gap = (there.direction - here.direction).norm();
  const double noise = 4.5 * frame_.range_sigma();
  if (result.neighbour == kNoLabel) {
    // Clutter, or a pixel between two surfaces: compare it with this plane continued.
    const double expected = range_to(plane, there);
    const double reference = expected > 0.0 ? expected : range_there + (2.0 * noise);
    const double slack = noise + (0.5 * gap * reference * cotangent_of_incidence(plane, there.direction));
    result.type = range_there > reference + slack   ? EdgeType::Occluding
                  : range_there < reference - slack ? EdgeType::Occluded
                                                    : EdgeType::NoData;
    return result;
  }
  // Both planes continued to the ray in the middle of the gap.
  const Plane& beyond = planes_[static_cast<std::size_t>(result.neighbour)];
  Ray middle;
  middle.origin = 0.5 * (here.origin + there.origin);
  middle.direction = (here.direction + there.direction).normalized();
  const double a = range_to(plane, middle);
  const double b = range_to(beyond, middle);
  if (a <= 0.0 || b <= 0.0) {
    result.type = a <= 0.0 && b > 0.0 ? EdgeType::Occluded : EdgeType::Occluding;
    return result;
  }
  const double slack =
      noise + (0.5 * gap * std::min(a, b) *
               (cotangent_of_incidence(plane, middle.direction) + cotangent_of_incidence(beyond, middle.direction)));
  const bool meets = std::abs(a - b) <= slack && steps <= kReach;
  result.type = meets ? EdgeType::Crease : (b > a ? EdgeType::Occluding : EdgeType::Occluded);
  return result;
}

double BoundaryTracer::footprint(std::size_t k) const {
  if (!frame_.is_valid(k)) { return 0.0; }
  const Plane& plane = planes_[static_cast<std::size_t>(label_)];
  constexpr double kLeastIncidence = 0.3;
  const double incidence = std::max(-plane.normal.dot(frame_.direction(k)), kLeastIncidence);
  return static_cast<double>(frame_.image().range_m[k]) * frame_.image().step_rad / incidence;
}

std::uint8_t& BoundaryTracer::visited(const State& s) {
  return visited_[frame_.topology().index(s.i, s.j)];
}

CrackRing BoundaryTracer::follow(const State& start) {
  const auto bit = [](const State& s) {
    return static_cast<std::uint8_t>(1U << static_cast<unsigned>(s.side_i != 0 ? 1 + s.side_i : 2 + s.side_j));
  };
  CrackRing ring;
  State state = start;
  Vec2 last_end = Vec2::Zero();
  do {
    visited(state) = static_cast<std::uint8_t>(visited(state) | bit(state));
    const Beyond beyond = look_beyond(state);
    const std::size_t k = frame_.topology().index(state.i, state.j);
    ring.cracks.push_back({k, beyond.neighbour, beyond.type, last_end, footprint(k)});
    last_end = corner(state);
    state = next(state);
  } while (state.i != start.i || state.j != start.j || state.side_i != start.side_i || state.side_j != start.side_j);
  ring.cracks.front().start = last_end;
  return ring;
}

std::vector<CrackRing> BoundaryTracer::trace(std::int32_t label, std::span<const Run> runs) {
  visited_.resize(frame_.image().size(), 0);
  label_ = label;
  std::vector<CrackRing> rings;
  const auto start_at = [&](int i, int j, int side) {
    const State state{i, j, 0, side, 1};
    const auto bit = static_cast<unsigned>(2 + side);
    if (((visited(state) >> bit) & 1U) == 0U && !is_inside(i, j + side)) { rings.push_back(follow(state)); }
  };
  // Every boundary has cracks at the ends of runs; only one that surrounds the whole raster's rim may have none.
  for (const Run& run : runs) {
    start_at(run.line, run.j0, -1);
    start_at(run.line, run.j1 - 1, 1);
  }
  return rings;
}

namespace {

constexpr std::size_t kMaxHole = 4;

/// The pixels without label around a seed when they are few and surrounded by one label alone; else empty.
std::int32_t find_hole(const SegmentFrame& frame, const Labels& labels, std::size_t seed,
                       std::vector<std::size_t>& hole) {
  hole.assign(1, seed);
  std::int32_t around = kNoLabel;
  bool is_closed = true;
  for (std::size_t next = 0; next < hole.size() && is_closed; ++next) {
    const int i = frame.line_of(hole[next]);
    const int j = frame.column_of(hole[next]);
    const RasterTopology& topology = frame.topology();
    is_closed =
        j > 0 && j + 1 < topology.columns() && topology.at(i - 1, j).is_inside && topology.at(i + 1, j).is_inside;
    topology.for_each_neighbour4(i, j, [&](std::size_t n) {
      if (labels[n] == kNoLabel) {
        if (std::find(hole.begin(), hole.end(), n) == hole.end()) { hole.push_back(n); }
      } else {
        is_closed = is_closed && (around == kNoLabel || around == labels[n]);
        around = labels[n];
      }
    });
    is_closed = is_closed && hole.size() <= kMaxHole;
  }
  return is_closed ? around : kNoLabel;
}

}  // namespace

void fill_small_holes(const SegmentFrame& frame, const std::vector<Plane>& planes, Labels& labels) {
  constexpr double kBehind = 5.0;
  std::vector<std::size_t> hole;
  const int columns = frame.image().columns;
  for (std::size_t seed = 0; seed + 1 < labels.size(); ++seed) {
    // Only a pixel that a label precedes, and only where the gap in the line is short.
    if (labels[seed] == kNoLabel || labels[seed + 1] != kNoLabel) { continue; }
    const int room = columns - 1 - frame.column_of(seed);
    int gap = 0;
    while (gap < room && gap <= static_cast<int>(kMaxHole) &&
           labels[seed + static_cast<std::size_t>(gap) + 1] == kNoLabel) {
      ++gap;
    }
    if (gap == room || gap > static_cast<int>(kMaxHole)) { continue; }
    const std::int32_t around = find_hole(frame, labels, seed + 1, hole);
    if (around == kNoLabel) { continue; }
    const Plane& plane = planes[static_cast<std::size_t>(around)];
    const bool is_window = std::any_of(hole.begin(), hole.end(), [&](std::size_t k) {
      if (!frame.is_valid(k)) { return false; }
      const double e = plane.normal.dot(frame.point(k) + frame.image().sensor_V - plane.centroid);
      return e < -kBehind * std::sqrt(frame.variance(k, plane.normal).total());
    });
    if (is_window) { continue; }
    for (const std::size_t k : hole) { labels[k] = around; }
  }
}

CreaseLine crease_line(const Plane& own, const Plane& other) {
  const Vec2 g(own.e2.dot(other.normal), own.e3.dot(other.normal));
  constexpr double kTooParallel = 0.17;  // sine of 10 degrees
  CreaseLine line;
  const double norm = g.norm();
  if (norm < kTooParallel) { return line; }
  line.is_defined = true;
  line.normal = g / norm;
  line.offset = other.normal.dot(other.centroid - own.centroid) / norm;
  return line;
}

void add_shared_borders(std::int32_t label, const CrackRing& ring, std::vector<SharedBorder>& borders) {
  for (std::size_t v = 0; v < ring.cracks.size(); ++v) {
    const Crack& crack = ring.cracks[v];
    if (crack.neighbour == kNoLabel) { continue; }
    const double length = (ring.cracks[(v + 1) % ring.cracks.size()].start - crack.start).norm();
    const SharedBorder key{std::min(label, crack.neighbour), std::max(label, crack.neighbour), 0.0, 0.0};
    const auto less = [](const SharedBorder& x, const SharedBorder& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; };
    auto it = std::lower_bound(borders.begin(), borders.end(), key, less);
    if (it == borders.end() || it->a != key.a || it->b != key.b) { it = borders.insert(it, key); }
    // Each of the two patches sees the border once.
    (crack.type == EdgeType::Crease ? it->crease_m : it->jump_m) += 0.5 * length;
  }
}

}  // namespace rosid::mapping
