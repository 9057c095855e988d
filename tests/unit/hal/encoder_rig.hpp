#pragma once
// A shaft with an incremental encoder in virtual time: it turns as told, its edges reach a quadrature decoder in
// batches, with faults between the encoder, the kernel and the reader.

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "base/units.hpp"
#include "hal/turret/quadrature.hpp"

namespace rosid::hal::test {

/// The edges of an encoder whose channels have their borders at whole positions (counts); the index is high from z +
/// 0.5 to z + 2.5 in every turn.
class EncoderModel {
 public:
  explicit EncoderModel(std::int64_t counts_per_turn, std::int64_t z) : turn_(counts_per_turn), z_(z) {}

  /// Edges of an even motion from the present position to this one.
  std::vector<EdgeRecord> move(Time t0, Time t1, double to) {
    std::vector<EdgeRecord> edges;
    const double from = position_;
    const double span = to - from;
    const auto at = [&](double where) { return t0 + duration_from_s(to_s(t1 - t0) * (where - from) / span); };
    const bool is_up = to > from;
    const double low = std::min(from, to);
    const double high = std::max(from, to);
    for (auto n = static_cast<std::int64_t>(std::floor(low)) + 1; static_cast<double>(n) <= high; ++n) {
      const auto entered = is_up ? n : n - 1;
      const auto place = ((entered % 4) + 4) % 4;
      const bool a = place == 1 || place == 2;
      const bool b = place == 2 || place == 3;
      // Upwards A changes into places 1 and 3, downwards into 0 and 2.
      const bool is_a = is_up ? place % 2 == 1 : place % 2 == 0;
      edges.push_back(
          {.t = at(static_cast<double>(n)), .line = is_a ? EdgeLine::A : EdgeLine::B, .is_rising = is_a ? a : b});
    }
    for (const auto& [flank, is_high_above] : {std::pair{0.5, true}, std::pair{2.5, false}}) {
      const double first = static_cast<double>(z_) + flank;
      const double turn = static_cast<double>(turn_);
      for (double f = first + (std::ceil((low - first) / turn) * turn); f <= high; f += turn) {
        if (f > low) { edges.push_back({.t = at(f), .line = EdgeLine::Z, .is_rising = is_high_above == is_up}); }
      }
    }
    std::stable_sort(edges.begin(), edges.end(), [](const auto& x, const auto& y) { return x.t < y.t; });
    position_ = to;
    return edges;
  }
  double position() const { return position_; }

 private:
  std::int64_t turn_;
  std::int64_t z_;
  double position_ = 0.3;
};

class EncoderRig final : public QuadratureDecoder::Listener {
 public:
  static constexpr std::int64_t kTurn = 4096;
  static constexpr std::int64_t kZ = 1000;

  explicit EncoderRig(bool has_index = true, std::int64_t configured_turn = kTurn)
      : decoder({.counts_per_turn = configured_turn, .has_index = has_index}, *this), encoder(kTurn, kZ) {
    decoder.on_link(now, true);
  }

  void on_reading(const QuadratureReading& reading) override { readings.push_back(reading); }

  /// Turns evenly; the reader comes every 10 ms, `latency` late.
  void turn(double rate_hz, double seconds) {
    const Time end = now + duration_from_s(seconds);
    while (now < end) {
      const Time t0 = now;
      now += std::chrono::milliseconds(10);
      const double to = encoder.position() + (rate_hz * static_cast<double>(kTurn) * to_s(now - t0));
      path.emplace_back(t0, encoder.position());
      auto edges = rate_hz == 0.0 ? std::vector<EdgeRecord>{} : encoder.move(t0, now, to);
      if (distort) { distort(edges); }
      send(edges);
    }
  }

  /// Through the kernel, which numbers the edges and may drop some after that.
  void send(const std::vector<EdgeRecord>& edges) {
    std::vector<EdgeRecord> batch;
    for (EdgeRecord edge : edges) {
      edge.sequence = ++sequence;
      edge.line_sequence = ++line_sequence.at(static_cast<std::size_t>(edge.line) % kEdgeLines);
      if (!drop_in_kernel || !drop_in_kernel(edge)) { batch.push_back(edge); }
    }
    if (disorder_in_kernel) { disorder_in_kernel(batch); }
    decoder.on_edges(now + latency, batch);
    decoder.tick(now + latency);
  }

  /// Where the shaft really was, measured from the index, turns included.
  double truth_rad(Time t) const {
    std::size_t k = path.size() - 1;
    while (k > 0 && path[k].first > t) { --k; }
    const Time t1 = k + 1 < path.size() ? path[k + 1].first : now;
    const double end = k + 1 < path.size() ? path[k + 1].second : encoder.position();
    const double s = to_s(t - path[k].first) / to_s(t1 - path[k].first);
    const double position = path[k].second + (s * (end - path[k].second));
    return 2.0 * kPi * (position - static_cast<double>(kZ)) / static_cast<double>(kTurn);
  }
  /// Largest error of the readings since the k-th, whole turns taken out.
  double worst_error_rad(std::size_t k = 0) const {
    double worst = 0.0;
    for (; k < readings.size(); ++k) {
      worst = std::max(worst, std::abs(wrap_to_pi(readings[k].angle_rad - truth_rad(readings[k].t))));
    }
    return worst;
  }
  const QuadratureCounters& counters() const { return decoder.counters(); }

  Time now = time_from_s(50.0);
  Duration latency{200'000};
  std::function<void(std::vector<EdgeRecord>&)> distort;  ///< on the wires
  std::function<bool(const EdgeRecord&)> drop_in_kernel;
  std::function<void(std::vector<EdgeRecord>&)> disorder_in_kernel;  ///< after they have their numbers
  std::uint32_t sequence = 0;
  std::array<std::uint32_t, kEdgeLines> line_sequence{};
  std::vector<QuadratureReading> readings;
  std::vector<std::pair<Time, double>> path;
  QuadratureDecoder decoder;
  EncoderModel encoder;
};

inline constexpr double kCount_rad = 2.0 * kPi / static_cast<double>(EncoderRig::kTurn);

}  // namespace rosid::hal::test
