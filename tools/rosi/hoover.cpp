#include "tools/rosi/hoover.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "base/contract.hpp"

namespace rosid::rosi {
namespace {

/// What the regions take part in.
struct Roles {
  std::vector<bool> is_correct;  ///< true region
  std::vector<bool> is_over;
  std::vector<bool> is_under;
  std::vector<bool> is_used;     ///< machine region takes part in anything
  std::vector<bool> is_partner;  ///< machine region is the correct one of some true region
};

/// The judgements, each after the definition of the same name.
class Judge {
 public:
  Judge(const RegionOverlap& overlap, double tolerance) : overlap_(overlap), tolerance_(tolerance) {
    roles_.is_correct.resize(overlap.truth.size());
    roles_.is_over.resize(overlap.truth.size());
    roles_.is_under.resize(overlap.truth.size());
    roles_.is_used.resize(overlap.machine.size());
    roles_.is_partner.resize(overlap.machine.size());
    std::vector<const RegionPair*> by_machine;
    by_machine.reserve(overlap.pairs.size());
    for (const RegionPair& pair : overlap.pairs) { by_machine.push_back(&pair); }
    std::stable_sort(by_machine.begin(), by_machine.end(),
                     [](const RegionPair* a, const RegionPair* b) { return a->machine < b->machine; });
    std::vector<const RegionPair*> by_truth;
    by_truth.reserve(overlap.pairs.size());
    for (const RegionPair& pair : overlap.pairs) { by_truth.push_back(&pair); }
    find_correct();
    for_each_group(
        by_truth, [](const RegionPair& pair) { return std::uint32_t{pair.truth}; },
        [this](auto group) { judge_truth(group); });
    for_each_group(
        by_machine, [](const RegionPair& pair) { return std::uint32_t{pair.machine}; },
        [this](auto group) { judge_machine(group); });
  }

  const Roles& roles() const { return roles_; }
  bool is_correct(const RegionPair& pair) const { return covers_truth(pair) && lies_on_surface(pair); }
  bool lies_on_surface(const RegionPair& pair) const {
    return reaches(pair.surface_weight, overlap_.machine[pair.machine].weight);
  }
  bool lies_on_region(const RegionPair& pair) const {
    return reaches(pair.weight, overlap_.machine[pair.machine].weight);
  }

 private:
  using Group = std::span<const RegionPair* const>;

  template <typename Key, typename Visit>
  static void for_each_group(const std::vector<const RegionPair*>& pairs, Key key, Visit visit) {
    for (std::size_t first = 0; first < pairs.size();) {
      std::size_t last = first;
      while (last < pairs.size() && key(*pairs[last]) == key(*pairs[first])) { ++last; }
      visit(Group(pairs).subspan(first, last - first));
      first = last;
    }
  }

  /// The slack is for sums that meet the share exactly: 0.55 times 100 is more than 55 in binary.
  bool reaches(double part, double whole) const { return part >= tolerance_ * whole * (1.0 - 1e-12); }
  bool covers_truth(const RegionPair& pair) const { return reaches(pair.weight, overlap_.truth[pair.truth].weight); }

  void find_correct() {
    for (const RegionPair& pair : overlap_.pairs) {
      if (!is_correct(pair)) { continue; }
      roles_.is_correct[pair.truth] = true;
      roles_.is_used[pair.machine] = true;
      roles_.is_partner[pair.machine] = true;
    }
  }

  void judge_truth(Group group) {
    double sum = 0.0;
    int count = 0;
    for (const RegionPair* pair : group) {
      if (!lies_on_surface(*pair)) { continue; }
      sum += pair->weight;
      ++count;
    }
    const std::uint32_t truth = group.front()->truth;
    if (count < 2 || !reaches(sum, overlap_.truth[truth].weight)) { return; }
    roles_.is_over[truth] = true;
    for (const RegionPair* pair : group) {
      if (lies_on_surface(*pair)) { roles_.is_used[pair->machine] = true; }
    }
  }

  void judge_machine(Group group) {
    double sum = 0.0;
    const RegionPair* first = nullptr;
    bool is_mixed = false;
    for (const RegionPair* pair : group) {
      if (!covers_truth(*pair)) { continue; }
      sum += pair->weight;
      if (first == nullptr) { first = pair; }
      is_mixed = is_mixed || overlap_.surface_of[pair->truth] != overlap_.surface_of[first->truth];
    }
    const std::uint16_t machine = group.front()->machine;
    if (!is_mixed || !reaches(sum, overlap_.machine[machine].weight)) { return; }
    roles_.is_used[machine] = true;
    for (const RegionPair* pair : group) {
      if (covers_truth(*pair)) { roles_.is_under[pair->truth] = true; }
    }
  }

  const RegionOverlap& overlap_;
  double tolerance_;
  Roles roles_;
};

/// How much of each machine region lies on the surface of each of its pairs.
void add_surface_weights(RegionOverlap& overlap) {
  std::map<std::pair<std::uint16_t, std::uint32_t>, double> sums;
  for (const RegionPair& pair : overlap.pairs) { sums[{pair.machine, overlap.surface_of[pair.truth]}] += pair.weight; }
  for (RegionPair& pair : overlap.pairs) {
    pair.surface_weight = sums.at({pair.machine, overlap.surface_of[pair.truth]});
  }
}

Outcome outcome_of(const Roles& roles, std::size_t region) {
  if (roles.is_correct[region]) { return Outcome::Correct; }
  if (roles.is_over[region]) { return Outcome::OverSegmented; }
  return roles.is_under[region] ? Outcome::UnderSegmented : Outcome::Missed;
}

int& count_of(HooverScore& score, Outcome outcome) {
  switch (outcome) {
    case Outcome::Correct: return score.correct;
    case Outcome::OverSegmented: return score.over_segmented;
    case Outcome::UnderSegmented: return score.under_segmented;
    case Outcome::NotCounted:
    case Outcome::Missed: break;
  }
  return score.missed;
}

}  // namespace

TruthRegions regions_from_labels(std::span<const std::uint16_t> labels) {
  TruthRegions truth;
  truth.region.assign(labels.begin(), labels.end());
  const std::uint32_t largest = labels.empty() ? 0U : *std::max_element(labels.begin(), labels.end());
  truth.surface_of.resize(largest + std::size_t{1});
  std::iota(truth.surface_of.begin(), truth.surface_of.end(), 0U);
  return truth;
}

RegionOverlap overlap_regions(std::span<const std::uint16_t> machine, const TruthRegions& truth,
                              std::span<const double> weight) {
  ROSID_EXPECT(machine.size() == truth.region.size());
  ROSID_EXPECT(weight.empty() || weight.size() == machine.size());
  RegionOverlap overlap;
  overlap.surface_of = truth.surface_of;
  overlap.truth.resize(truth.surface_of.size());
  const std::size_t largest = machine.empty() ? 0U : *std::max_element(machine.begin(), machine.end());
  overlap.machine.resize(largest + 1);
  std::map<std::pair<std::uint32_t, std::uint16_t>, double> shared;
  for (std::size_t k = 0; k < machine.size(); ++k) {
    const double w = weight.empty() ? 1.0 : weight[k];
    if (!(w > 0.0)) { continue; }
    const std::uint32_t region = truth.region[k];
    ++overlap.truth[region].pixels;
    overlap.truth[region].weight += w;
    ++overlap.machine[machine[k]].pixels;
    overlap.machine[machine[k]].weight += w;
    if (region != 0 && machine[k] != 0) { shared[{region, machine[k]}] += w; }
  }
  overlap.pairs.reserve(shared.size());
  for (const auto& [key, sum] : shared) {
    overlap.pairs.push_back({.truth = key.first, .machine = key.second, .weight = sum, .surface_weight = 0.0});
  }
  add_surface_weights(overlap);
  return overlap;
}

HooverScore score_regions(const RegionOverlap& overlap, const HooverOptions& options) {
  ROSID_EXPECT(options.tolerance > 0.5 && options.tolerance < 1.0);
  const Judge judge(overlap, options.tolerance);
  const Roles& roles = judge.roles();
  HooverScore score;
  score.outcome.resize(overlap.truth.size(), Outcome::NotCounted);
  for (std::size_t k = 1; k < overlap.truth.size(); ++k) {
    if (overlap.truth[k].pixels <= options.min_pixels) { continue; }
    score.outcome[k] = outcome_of(roles, k);
    ++score.truth_regions;
    ++count_of(score, score.outcome[k]);
  }
  for (std::size_t k = 1; k < overlap.machine.size(); ++k) {
    if (overlap.machine[k].pixels == 0) { continue; }
    ++score.machine_regions;
    score.noise += roles.is_used[k] ? 0 : 1;
  }
  std::vector<bool> is_fragment(overlap.machine.size());
  for (const RegionPair& pair : overlap.pairs) {
    if (score.outcome[pair.truth] != Outcome::Correct) { continue; }
    if (judge.is_correct(pair)) { score.correct_pairs.push_back(pair); }
    if (!roles.is_partner[pair.machine] && judge.lies_on_region(pair)) { is_fragment[pair.machine] = true; }
  }
  score.fragments = static_cast<int>(std::count(is_fragment.begin(), is_fragment.end(), true));
  return score;
}

}  // namespace rosid::rosi
