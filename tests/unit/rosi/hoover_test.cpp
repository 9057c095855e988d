#include "tools/rosi/hoover.hpp"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "tools/rosi/truth_regions.hpp"

namespace rosid::rosi {
namespace {

using Labels = std::vector<std::uint16_t>;

/// One pixel for each character: '.' is 0, letters count from 'a' = 1.
Labels pixels(std::string_view text) {
  Labels labels;
  for (const char c : text) { labels.push_back(c == '.' ? 0 : static_cast<std::uint16_t>(c - 'a' + 1)); }
  return labels;
}

HooverScore score(std::string_view machine, std::string_view truth, double tolerance = 0.8, int min_pixels = 0) {
  return score_regions(overlap_regions(pixels(machine), regions_from_labels(pixels(truth))),
                       {.tolerance = tolerance, .min_pixels = min_pixels});
}

/// correct, over, under, missed, noise, fragments
std::vector<int> counts(const HooverScore& s) {
  EXPECT_EQ(s.correct + s.over_segmented + s.under_segmented + s.missed, s.truth_regions);
  return {s.correct, s.over_segmented, s.under_segmented, s.missed, s.noise, s.fragments};
}

TEST(Hoover, TheTruthItselfIsCorrectAtEveryTolerance) {
  for (const double tolerance : {0.51, 0.6, 0.8, 0.99}) {
    const HooverScore s = score("bbbbaaacc..", "aaaabbbcc..", tolerance);
    EXPECT_EQ(counts(s), (std::vector{3, 0, 0, 0, 0, 0}));
    EXPECT_EQ(s.machine_regions, 3);
  }
}

TEST(Hoover, CorrectPairsAreListedWithTheirOverlap) {
  const HooverScore s = score("zzzzzyyyyy", "aaaaaabbbb");
  ASSERT_EQ(s.correct_pairs.size(), 2U);
  EXPECT_EQ(s.correct_pairs[0].truth, 1U);
  EXPECT_EQ(s.correct_pairs[0].machine, 26U);
  EXPECT_DOUBLE_EQ(s.correct_pairs[0].weight, 5.0);
  EXPECT_EQ(s.correct_pairs[1].machine, 25U);
  EXPECT_DOUBLE_EQ(s.correct_pairs[1].weight, 4.0);
}

TEST(Hoover, AShareThatIsMetExactlyIsEnough) {
  EXPECT_EQ(counts(score("zzzzzzzz..", "aaaaaaaaaa", 0.8)), (std::vector{1, 0, 0, 0, 0, 0}));
  EXPECT_EQ(counts(score("zzzzzzz...", "aaaaaaaaaa", 0.8)), (std::vector{0, 0, 0, 1, 1, 0}));
  const Labels truth(100, 1);
  Labels machine(100, 0);
  std::fill_n(machine.begin(), 55, std::uint16_t{1});
  EXPECT_EQ(
      score_regions(overlap_regions(machine, regions_from_labels(truth)), {.tolerance = 0.55, .min_pixels = 0}).correct,
      1);
}

TEST(Hoover, BothSharesCountForCorrect) {
  // All of a is in z, but z reaches far beyond a: the rest belongs to nothing.
  EXPECT_EQ(counts(score("zzzzzzzzzz", "aaaa......")), (std::vector{0, 0, 0, 1, 1, 0}));
}

TEST(Hoover, TwoPatchesOnOneSurfaceAreOverSegmentation) {
  EXPECT_EQ(counts(score("xxxxxyyyyy", "aaaaaaaaaa")), (std::vector{0, 1, 0, 0, 0, 0}));
  // Together they have less than the tolerance asks for: the surface is missed and both are noise.
  EXPECT_EQ(counts(score("xxxx..yyy.", "aaaaaaaaaa")), (std::vector{0, 0, 0, 1, 2, 0}));
  // One of the two lies half elsewhere, too much for either surface: nobody has a, nobody has b alone.
  EXPECT_EQ(counts(score("xxxxxyyyyyyyyyyy", "aaaaaaaaaabbbbbb", 0.7)), (std::vector{0, 0, 0, 2, 2, 0}));
}

TEST(Hoover, OnePatchOnTwoSurfacesIsUnderSegmentation) {
  EXPECT_EQ(counts(score("xxxxxxxxxx", "aaaaabbbbb")), (std::vector{0, 0, 2, 0, 0, 0}));
  // The surfaces make up too little of the patch.
  EXPECT_EQ(counts(score("xxxxxxxxxxxx", "aaaabbbb....")), (std::vector{0, 0, 0, 2, 1, 0}));
}

TEST(Hoover, ASurfaceSwallowedByACorrectPatchIsUnderSegmented) {
  EXPECT_EQ(counts(score("xxxxxxxxxx", "aaaaaaaaab")), (std::vector{1, 0, 1, 0, 0, 0}));
}

TEST(Hoover, AShredOnACorrectSurfaceIsAFragmentAndNoNoise) {
  const HooverScore s = score("xxxxxxxxxy", "aaaaaaaaaa");
  EXPECT_EQ(counts(s), (std::vector{1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(s.correct_pairs.size(), 1U);
}

TEST(Hoover, APatchWhereNothingIsIsNoise) {
  EXPECT_EQ(counts(score("xxxxx.yyy.", "aaaaa.....")), (std::vector{1, 0, 0, 0, 1, 0}));
}

TEST(Hoover, WhatIsNotSeenAtAllIsMissed) {
  EXPECT_EQ(counts(score("..........", "aaaaabbbbb")), (std::vector{0, 0, 0, 2, 0, 0}));
}

TEST(Hoover, ASmallRegionIsNotCountedButItsPatchIsNoNoise) {
  const HooverScore s = score("xxxxxyyy..", "aaaaabbb..", 0.8, 3);
  EXPECT_EQ(s.truth_regions, 1);
  EXPECT_EQ(counts(s), (std::vector{1, 0, 0, 0, 0, 0}));
  EXPECT_EQ(s.correct_pairs.size(), 1U);
  EXPECT_EQ(score("xxxxxyyyy.", "aaaaabbbb.", 0.8, 3).truth_regions, 2);
}

TEST(Hoover, EmptyImagesScoreNothing) {
  EXPECT_EQ(counts(score("", "")), (std::vector{0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(counts(score("....", "....")), (std::vector{0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(counts(score("xx..", "....")), (std::vector{0, 0, 0, 0, 1, 0}));
}

TEST(Hoover, WeightsDecideWhatAShareIs) {
  const Labels truth = pixels("aaaaaaaaaa");
  const Labels machine = pixels("xxxxxxxxx.");
  std::vector<double> area(10, 1.0);
  area.back() = 9.0;
  const TruthRegions regions = regions_from_labels(truth);
  const HooverOptions options{.tolerance = 0.8, .min_pixels = 0};
  EXPECT_EQ(score_regions(overlap_regions(machine, regions), options).correct, 1);
  EXPECT_EQ(score_regions(overlap_regions(machine, regions, area), options).correct, 0);
  area.back() = 0.0;  // left out altogether
  const RegionOverlap overlap = overlap_regions(machine, regions, area);
  EXPECT_EQ(overlap.truth[1].pixels, 9);
  EXPECT_DOUBLE_EQ(overlap.truth[1].weight, 9.0);
}

TEST(Hoover, APatchMayUniteThePartsOfOneSurfaceButNeedNot) {
  TruthRegions truth = regions_from_labels(pixels("aaaaa..bbbbb"));
  truth.surface_of = {0, 7, 7};
  const HooverOptions options{.tolerance = 0.8, .min_pixels = 0};
  const HooverScore united = score_regions(overlap_regions(pixels("xxxxx..xxxxx"), truth), options);
  EXPECT_EQ(counts(united), (std::vector{2, 0, 0, 0, 0, 0}));
  EXPECT_EQ(united.correct_pairs.size(), 2U);
  const HooverScore apart = score_regions(overlap_regions(pixels("xxxxx..yyyyy"), truth), options);
  EXPECT_EQ(counts(apart), (std::vector{2, 0, 0, 0, 0, 0}));
  // One part alone does not stand for both.
  const HooverScore half = score_regions(overlap_regions(pixels("xxxxx......."), truth), options);
  EXPECT_EQ(counts(half), (std::vector{1, 0, 0, 1, 0, 0}));
}

TEST(TruthRegions, WhatIsFarApartIsCutAndWhatIsNearIsNot) {
  const mapping::RasterTopology flat(mapping::Topology::Rectangle, 1, 12);
  const TruthRegions truth = cut_into_regions(pixels("aa...aabbbba"), flat);
  EXPECT_EQ(truth.region, (std::vector<std::uint32_t>{1, 1, 0, 0, 0, 1, 1, 2, 2, 2, 2, 3}));
  EXPECT_EQ(truth.surface_of, (std::vector<std::uint32_t>{0, 1, 2, 1}));
}

TEST(TruthRegions, NearDiagonallyIsNearToo) {
  const mapping::RasterTopology flat(mapping::Topology::Rectangle, 3, 3);
  EXPECT_EQ(cut_into_regions(pixels("a...b...a"), flat, 1).surface_of.size(), 3U);
  EXPECT_EQ(cut_into_regions(pixels("a...b...a"), flat, 0).surface_of.size(), 4U);
}

TEST(TruthRegions, RegionsGrowOverTheSeam) {
  // First and last line; columns of 6: over the Moebius seam column 0 meets column 5.
  std::string text(60, '.');
  text[0] = text[59] = 'a';
  text[5] = text[57] = 'b';
  const auto regions = [&text](mapping::Topology topology) {
    return cut_into_regions(pixels(text), mapping::RasterTopology(topology, 10, 6), 0).surface_of.size() - 1;
  };
  EXPECT_EQ(regions(mapping::Topology::Rectangle), 4U);
  EXPECT_EQ(regions(mapping::Topology::Cylinder), 4U);
  EXPECT_EQ(regions(mapping::Topology::Moebius), 3U);
}

}  // namespace
}  // namespace rosid::rosi
