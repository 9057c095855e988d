// The segmenter's tools, each against a plainer way to the same result.

#include "mapping/segment_parts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/symmetric.hpp"
#include "mapping/boundary.hpp"
#include "mapping/segment_blocks.hpp"
#include "mapping/segment_moments.hpp"
#include "mapping/segment_runs.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::box_room;
using test::Look;
using test::look_at;

TEST(QuickFit, AgreesWithTheIterativeDecomposition) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> magnitude(-3.0, 1.0);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vec3 size(std::pow(10.0, magnitude(random)), std::pow(10.0, magnitude(random)),
                    std::pow(10.0, magnitude(random)));
    const Mat3 turn = so3_exp(Vec3(gauss(random), gauss(random), gauss(random))).toRotationMatrix();
    const Vec3 centre(gauss(random), gauss(random), 3.0 + gauss(random));
    Moments moments;
    for (int k = 0; k < 20; ++k) {
      moments.add(centre + turn * size.cwiseProduct(Vec3(gauss(random), gauss(random), gauss(random))));
    }
    const QuickPlane plane = fit_quick(moments);
    const auto truth = eigenpairs(moments.scatter());
    const double scale = truth.values[2];
    EXPECT_NEAR(plane.lambda[0], truth.values[0], 1e-7 * scale);
    EXPECT_NEAR(plane.lambda[1], truth.values[1], 1e-7 * scale);
    EXPECT_NEAR(plane.lambda[2], truth.values[2], 1e-7 * scale);
    EXPECT_NEAR(plane.e2.cross(plane.e3).dot(plane.normal), 1.0, 1e-9);
    EXPECT_LE(plane.normal.dot(plane.centroid), 0.0);
    if (truth.values[0] < 0.5 * truth.values[1] && truth.values[1] > 1e-6 * scale) {
      EXPECT_GT(std::abs(plane.normal.dot(truth.vectors.col(0))), 1.0 - 1e-6);
    }
  }
}

TEST(QuickFit, PointsThatSpanNothingGiveAUnitNormal) {
  for (const Vec3& spread : {Vec3(0.0, 0.0, 0.0), Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1e-9, 0.0), Vec3(1.0, 1.0, 1.0)}) {
    Moments moments;
    for (int k = -2; k <= 2; ++k) { moments.add(Vec3(1.0, 2.0, 3.0) + k * spread); }
    const QuickPlane plane = fit_quick(moments);
    EXPECT_TRUE(plane.normal.allFinite());
    EXPECT_NEAR(plane.normal.norm(), 1.0, 1e-9);
    EXPECT_TRUE(plane.lambda.allFinite());
  }
}

TEST(BlockGrid, SumsAreThoseOfThePixels) {
  Look look;
  look.lines = 77;
  look.columns = 59;
  look.dropout = 0.1;
  const auto picture = look_at(box_room(Vec3(-2, -2, 0), Vec3(4, 1.8, 2.5)), look, {});
  SegmentFrame frame{Calibration{}};
  ASSERT_TRUE(frame.prepare(picture.image));
  BlockGrid grid;
  grid.build(frame);
  for (const auto& [r0, r1, c0, c1] : {std::array{0, grid.rows(), 0, grid.columns()}, std::array{1, 3, 2, 5}}) {
    Moments plain;
    for (int row = r0; row < r1; ++row) {
      for (int column = c0; column < c1; ++column) {
        const PixelBox box = grid.box(row, column);
        for (int i = box.i0; i < box.i1; ++i) {
          for (int j = box.j0; j < box.j1; ++j) {
            const std::size_t k = picture.image.index(i, j);
            if (frame.is_usable(k)) { plain.add(frame.point(k)); }
          }
        }
      }
    }
    const Moments sum = grid.sum(r0, r1, c0, c1);
    EXPECT_EQ(sum.count, plain.count);
    EXPECT_LT((sum.products() - plain.products()).norm(), 1e-4 * plain.products().norm());
  }
}

class Runs : public ::testing::Test {
 protected:
  Runs() {
    look.lines = 40;
    look.columns = 31;
    picture = look_at(box_room(Vec3(-2, -2, 0), Vec3(4, 1.8, 2.5)), look, {});
    frame.prepare(picture.image);
    labels.assign(picture.image.size(), kNoLabel);
  }
  void paint(int i0, int i1, int j0, int j1, std::int32_t label) {
    for (int i = i0; i < i1; ++i) {
      for (int j = j0; j < j1; ++j) { labels[picture.image.index(i, j)] = label; }
    }
  }
  Look look;
  test::Picture picture;
  SegmentFrame frame{Calibration{}};
  Labels labels;
  RunList runs;
};

TEST_F(Runs, ComponentsHoldTogetherOverTheSeam) {
  paint(36, 40, 20, 25, 3);
  paint(0, 4, 6, 11, 3);  // the same columns, flipped
  paint(10, 12, 3, 9, 5);
  runs.from_components(frame, labels);
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs.pixels(0), 40);
  EXPECT_EQ(runs.region_of(0), 3);
  EXPECT_EQ(runs.pixels(1), 12);
  EXPECT_EQ(runs.region_of(1), 5);
}

TEST_F(Runs, ComponentsComeLargestFirst) {
  paint(5, 15, 2, 8, 1);
  paint(5, 15, 11, 18, 1);  // of the same label, but not touching
  paint(18, 20, 2, 8, 2);
  runs.from_components(frame, labels);
  ASSERT_EQ(runs.size(), 3U);
  EXPECT_EQ(runs.pixels(0), 70);
  EXPECT_EQ(runs.pixels(1), 60);
  EXPECT_EQ(runs.region_of(1), 1);
  EXPECT_EQ(runs.region_of(2), 2);
}

/// A picture of a wall behind a pillar, with regions made of painted labels.
class Parts : public Runs {
 protected:
  void fit_regions(std::size_t count) {
    regions.resize(count);
    for (std::size_t k = 0; k < labels.size(); ++k) {
      if (labels[k] != kNoLabel) { regions[static_cast<std::size_t>(labels[k])].moments.add(frame.point(k)); }
    }
    for (Region& region : regions) { region.plane = fit_quick(region.moments); }
  }
  std::vector<Region> regions;
};

TEST_F(Parts, OfOneSurfaceStayTogether) {
  // On the wall ahead, with columns in between that belong to something else.
  paint(0, 40, 11, 14, 0);
  paint(0, 40, 17, 20, 0);
  fit_regions(1);
  const Labels before = labels;
  separate_parts(frame, {}, regions, labels, runs);
  EXPECT_EQ(labels, before);
  EXPECT_EQ(regions.size(), 1U);
}

TEST_F(Parts, OnAnotherSurfaceBecomeTheirOwn) {
  paint(0, 40, 10, 21, 0);  // ahead
  paint(8, 14, 0, 5, 0);    // to one side
  fit_regions(1);
  separate_parts(frame, {}, regions, labels, runs);
  ASSERT_EQ(regions.size(), 2U);
  EXPECT_EQ(labels[picture.image.index(10, 2)], 1);
  EXPECT_EQ(labels[picture.image.index(10, 15)], 0);
  EXPECT_EQ(regions[1].moments.count, 30.0);
}

TEST_F(Parts, TooSmallForAPatchLoseTheirLabel) {
  paint(0, 40, 10, 21, 0);
  paint(8, 10, 0, 5, 0);
  fit_regions(1);
  separate_parts(frame, {}, regions, labels, runs);
  EXPECT_EQ(regions.size(), 1U);
  EXPECT_EQ(labels[picture.image.index(8, 2)], kNoLabel);
}

TEST(Touching, FindsWhatAllPairsFind) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> place(0.0, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Vec2> vertices;
    for (int v = 0; v < 12; ++v) { vertices.emplace_back(place(random), place(random)); }
    std::vector<RingEdge> edges;
    append_edges(vertices, 0, edges);
    std::vector<std::size_t> plain;
    for (std::size_t a = 0; a < edges.size(); ++a) {
      for (std::size_t b = 0; b < edges.size(); ++b) {
        const std::size_t apart = a > b ? a - b : b - a;
        if (apart <= 1 || apart + 1 == edges.size()) { continue; }
        // Points on a's line at b's ends lie on both sides, and the other way round.
        const auto side = [](const RingEdge& e, const Vec2& p) {
          return ((e.to.x() - e.from.x()) * (p.y() - e.from.y())) - ((e.to.y() - e.from.y()) * (p.x() - e.from.x()));
        };
        if (side(edges[a], edges[b].from) * side(edges[a], edges[b].to) < 0.0 &&
            side(edges[b], edges[a].from) * side(edges[b], edges[a].to) < 0.0) {
          plain.push_back(a);
          break;
        }
      }
    }
    EXPECT_EQ(find_touching(edges), plain);
  }
}

}  // namespace
}  // namespace rosid::mapping
