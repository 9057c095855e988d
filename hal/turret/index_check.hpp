#pragma once
// Whether the counts between two passes of the index are those of whole turns. Pure.

#include <cstdint>

namespace rosid::hal {

/// The index stands at multiples of the counts of a turn once it has been found. Its flank may fall together with an
/// edge of a channel, in either order: one count of difference means nothing.
class IndexCheck {
 public:
  static constexpr std::int64_t kTolerance = 1;
  /// So many turns without the index: it is gone.
  static constexpr int kMostMissed = 3;

  enum class Verdict : std::uint8_t {
    Found,      ///< the first one: it becomes the origin
    Confirmed,  ///< the counts are right
    Mismatch,   ///< an extra pulse or lost counts: the next one will tell
    Relocked,   ///< counts had been lost; they are right again after the shift
  };
  struct Result {
    Verdict verdict = Verdict::Confirmed;
    std::int64_t shift = 0;  ///< to be added to the count
  };

  /// counts_per_turn: at least 4.
  explicit IndexCheck(std::int64_t counts_per_turn) : counts_per_turn_(counts_per_turn) {}

  /// The index was passed at this count.
  Result on_index(std::int64_t count);
  /// The count changed. True: an index that was due did not come.
  bool on_count(std::int64_t count);
  /// Counts are known to be missing: the next index is believed.
  void doubt();
  /// As built.
  void reset() { *this = IndexCheck(counts_per_turn_); }

  bool is_found() const { return is_found_; }
  /// The count can be believed.
  bool is_certain() const { return is_found_ && !is_doubtful_ && !has_candidate_ && !is_gone() && !is_turn_wrong(); }
  bool is_gone() const { return missed_in_a_row_ >= kMostMissed; }
  /// The index comes again and again after the same number of counts, but not after those of a turn.
  bool is_turn_wrong() const { return equal_spacings_ >= kMostMissed; }

 private:
  Result judge(std::int64_t count);
  void accept(std::int64_t position);
  void measure(std::int64_t count);
  /// Distance to the nearest multiple of a turn.
  std::int64_t remainder(std::int64_t count) const;

  std::int64_t counts_per_turn_;
  bool is_found_ = false;
  bool is_doubtful_ = false;
  bool has_candidate_ = false;
  std::int64_t candidate_ = 0;
  bool has_count_ = false;
  std::int64_t last_ = 0;  // where the index was or should have been passed last
  int missed_in_a_row_ = 0;
  bool has_index_ = false;
  std::int64_t last_index_ = 0;  // where the index was passed last
  std::int64_t spacing_ = 0;
  int equal_spacings_ = 0;  // in a row, other than a turn
};

}  // namespace rosid::hal
