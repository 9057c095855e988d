#include "msgs/convert.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "base/units.hpp"
#include "support/sample_map.hpp"

namespace rosid::msgs {
namespace {

using testing::sample_map;
using testing::sample_patch;

/// Through the wire and back.
template <typename Message>
Message over_the_wire(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  const int length = static_cast<int>(bytes.size());
  EXPECT_EQ(message.encode(bytes.data(), 0, length), length);
  Message decoded{};
  EXPECT_EQ(decoded.decode(bytes.data(), 0, length), length);
  return decoded;
}

// The values libbot2's bot_core types have: programs built with those read rosid's messages.
TEST(Convert, BotCoreFingerprints) {
  EXPECT_EQ(static_cast<std::uint64_t>(pose_t::getHash()), 0x2e16efb052b0105eULL);
  EXPECT_EQ(static_cast<std::uint64_t>(planar_lidar_t::getHash()), 0xe3d17423180b5e8dULL);
}

TEST(Convert, OwnTypesHaveDifferentFingerprints) {
  const std::set<std::int64_t> hashes{aid_t::getHash(),          fix_t::getHash(),       health_t::getHash(),
                                      map_chunk_t::getHash(),    pose_t::getHash(),      state_t::getHash(),
                                      planar_lidar_t::getHash(), view_chunk_t::getHash()};
  EXPECT_EQ(hashes.size(), 8U);
}

PoseEstimate some_estimate() {
  PoseEstimate estimate;
  estimate.t = time_from_ns(5'000'000'000);
  // V turned by 90 degrees to the left in W.
  estimate.X_WV = {{1.0, 2.0, 3.0}, {std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)}};
  estimate.X_OV.p_m = {4.0, 5.0, 6.0};
  estimate.X_WO.p_m = {7.0, 8.0, 9.0};
  for (std::size_t k = 0; k < 36; ++k) { estimate.covariance_W[k] = static_cast<double>(k); }
  estimate.twist_V = {1.0, 0.0, 0.0, 0.0, 0.2, 0.5};
  estimate.wheel_scale = {0.01, -0.02};
  estimate.tilt_bias = {0.001, 0.002};
  estimate.sequence = 77;
  estimate.fixes_applied = 3;
  estimate.status = pose_status::kInitialised | pose_status::kCoasting;
  return estimate;
}

TEST(Convert, PoseTurnsVelocitiesIntoTheWorld) {
  const pose_t message = over_the_wire(to_pose_message(some_estimate(), {1'000'000}));
  EXPECT_EQ(message.utime, 6'000'000);
  EXPECT_EQ(message.pos[1], 2.0);
  EXPECT_NEAR(message.vel[0], 0.0, 1e-12);
  EXPECT_NEAR(message.vel[1], 1.0, 1e-12);
  EXPECT_NEAR(message.rotation_rate[0], -0.2, 1e-12);
  EXPECT_NEAR(message.rotation_rate[2], 0.5, 1e-12);
  EXPECT_NEAR(message.orientation[3], std::sqrt(0.5), 1e-15);
  EXPECT_EQ(message.accel[0], 0.0);
}

TEST(Convert, State) {
  const state_t message = over_the_wire(to_state_message(some_estimate(), {}));
  EXPECT_EQ(message.utime, 5'000'000);
  EXPECT_EQ(message.sequence, 77);
  EXPECT_EQ(message.fixes_applied, 3);
  EXPECT_EQ(message.status, 1 + 4);  // initialised, coasting
  EXPECT_EQ(message.position_OV[2], 6.0);
  EXPECT_EQ(message.position_WO[0], 7.0);
  EXPECT_EQ(message.covariance_WV[35], 35.0);
  EXPECT_EQ(message.twist_V[5], 0.5);
  EXPECT_EQ(message.wheel_scale[1], -0.02);
  EXPECT_EQ(message.tilt_bias[1], 0.002);
}

// The constants in the .lcm files must say what the program's enumerations mean.
TEST(Convert, ConstantsAgree) {
  EXPECT_EQ(state_t::STATIONARY, pose_status::kStationary);
  EXPECT_EQ(state_t::TILT_MISSING, pose_status::kTiltMissing);
  EXPECT_EQ(state_t::SLIP_SUSPECTED, pose_status::kSlipSuspected);
  EXPECT_EQ(state_t::FIX_REJECTING, pose_status::kFixRejecting);
  EXPECT_EQ(state_t::NUMERIC_REPAIR, pose_status::kNumericRepair);
  EXPECT_EQ(aid_t::STAND_STILL, static_cast<int>(Aid::StandStill));
  EXPECT_EQ(aid_t::SURFACE_FIX, static_cast<int>(Aid::SurfaceFix));
  EXPECT_EQ(aid_t::NUMERIC_FAULT, static_cast<int>(AidOutcome::NumericFault));
  EXPECT_EQ(aid_t::REJECTED_GATE, static_cast<int>(AidOutcome::RejectedGate));
  EXPECT_EQ(health_t::FAULTY, static_cast<int>(DeviceState::Faulty));
  EXPECT_EQ(health_t::RUNNING, static_cast<int>(DeviceState::Running));
  EXPECT_EQ(patch_block_t::NO_DATA, static_cast<int>(mapping::EdgeType::NoData));
  EXPECT_EQ(patch_block_t::OCCLUDED, static_cast<int>(mapping::EdgeType::Occluded));
}

TEST(Convert, LaserHasNoNanAndLooksAhead) {
  ScanLine line;
  line.t_first_beam = time_from_ns(1'000'000);
  line.beam_count = 3;
  line.first_angle_rad = rad_from_deg(40.0);
  line.angle_step_rad = rad_from_deg(1.0);
  line.range_m[0] = 1.5F;
  line.range_m[1] = std::numeric_limits<float>::quiet_NaN();
  line.range_m[2] = 2.5F;
  const planar_lidar_t message = over_the_wire(to_laser_message(line, {}));
  EXPECT_EQ(message.ranges, (std::vector<float>{1.5F, 0.0F, 2.5F}));
  EXPECT_NEAR(message.rad0, rad_from_deg(-50.0), 1e-6);
  EXPECT_NEAR(message.radstep, rad_from_deg(1.0), 1e-7);
  EXPECT_EQ(message.nintensities, 0);
  line.beam_count = 60000;  // whatever a driver says, nothing is read beyond the array
  EXPECT_EQ(to_laser_message(line, {}).nranges, kMaxBeams);
}

TEST(Convert, AidAndFix) {
  AidReport report;
  report.t_measured = time_from_ns(1'000'000);
  report.t_fused = time_from_ns(2'000'000);
  report.aid = Aid::SurfaceFix;
  report.outcome = AidOutcome::TooOld;
  report.dof = 6;
  report.innovation[5] = 0.25;
  report.view_id = 9;
  const aid_t aid = over_the_wire(to_aid_message(report, {10}));
  EXPECT_EQ(aid.utime, 1010);
  EXPECT_EQ(aid.utime_fused, 2010);
  EXPECT_EQ(aid.aid, aid_t::SURFACE_FIX);
  EXPECT_EQ(aid.outcome, aid_t::TOO_OLD);
  EXPECT_EQ(aid.innovation[5], 0.25);
  EXPECT_EQ(aid.view_id, 9);
  SurfaceFix fix;
  fix.t_view = time_from_ns(3'000'000);
  fix.information[7] = 4.0;
  fix.null_count = 2;
  const fix_t message = over_the_wire(to_fix_message(fix, {1}));
  EXPECT_EQ(message.utime, 3001);
  EXPECT_EQ(message.t_ns, 3'000'000);
  EXPECT_EQ(message.information[7], 4.0);
  EXPECT_EQ(message.null_count, 2);
}

TEST(Convert, Health) {
  HealthReport report;
  report.t = time_from_ns(10'000'000'000);
  report.devices[0].state = DeviceState::Running;
  report.devices[0].samples = 5;
  report.devices[0].t_last_data = time_from_ns(9'500'000'000);
  report.devices[0].bytes = 1ULL << 40U;
  ThreadHealth thread;
  thread.overruns = 1;
  report.threads.push_back({"io", thread});
  report.queues.push_back({"lines", 2, 7, 512});
  const health_t message = over_the_wire(to_health_message(report, {}));
  ASSERT_EQ(message.ndevices, kDeviceCount);
  EXPECT_EQ(message.device_name[0], "laser");
  EXPECT_EQ(message.device_state[0], health_t::RUNNING);
  EXPECT_NEAR(message.device_age_s[0], 0.5F, 1e-6F);
  EXPECT_EQ(message.device_age_s[1], -1.0F);
  EXPECT_EQ(message.bytes[0], 1LL << 40U);
  ASSERT_EQ(message.nthreads, 1);
  EXPECT_EQ(message.overruns[0], 1);
  ASSERT_EQ(message.nqueues, 1);
  EXPECT_EQ(message.queue_high_water[0], 7);
}

/// What a receiver puts together from the chunks of one version: id -> (patch index in its chunk, chunk).
TEST(Convert, ChunksHoldTheWholeMapOnceAndFitTheirLimit) {
  for (const std::uint32_t patches : {0U, 1U, 40U, 400U}) {
    const mapping::SurfaceMap map = sample_map(2, patches, 64);
    const auto chunks = to_map_messages(map, {});
    ASSERT_FALSE(chunks.empty());
    std::size_t next = 0;
    for (std::size_t k = 0; k < chunks.size(); ++k) {
      ASSERT_LE(chunks[k].getEncodedSize(), static_cast<int>(kMaxMessageBytes));
      const map_chunk_t chunk = over_the_wire(chunks[k]);
      EXPECT_EQ(chunk.version, static_cast<std::int64_t>(map.version));
      EXPECT_EQ(chunk.chunk, static_cast<std::int32_t>(k));
      EXPECT_EQ(chunk.nchunks, static_cast<std::int32_t>(chunks.size()));
      EXPECT_EQ(chunk.patches_total, static_cast<std::int32_t>(patches));
      EXPECT_EQ(chunk.npatches, chunk.patches.npatches);
      const patch_block_t& block = chunk.patches;
      std::size_t ring = 0;
      std::size_t vertex = 0;
      for (std::size_t i = 0; i < static_cast<std::size_t>(block.npatches); ++i, ++next) {
        ASSERT_LT(next, map.patches.size());
        const mapping::MapPatch& want = map.patches[next];
        EXPECT_EQ(block.id[i], static_cast<std::int32_t>(want.patch.id));
        EXPECT_EQ(block.normal_z[i], want.patch.plane.normal.z());
        EXPECT_EQ(block.axis_y[i], want.patch.plane.e2.y());
        EXPECT_EQ(block.centroid_x[i], want.patch.plane.centroid.x());
        EXPECT_FLOAT_EQ(block.covariance[(6 * i) + 5], static_cast<float>(want.patch.plane.covariance()(2, 2)));
        EXPECT_EQ(chunk.views[i], static_cast<std::int32_t>(want.views));
        EXPECT_EQ((chunk.flags[i] & map_chunk_t::FLOOR) != 0, want.is_floor);
        EXPECT_EQ((chunk.flags[i] & map_chunk_t::TENTATIVE) != 0, want.is_tentative);
        for (const auto* rings : {&want.patch.outer, &want.patch.inner}) {
          for (const mapping::Ring& want_ring : *rings) {
            ASSERT_LT(ring, block.ring_size.size());
            EXPECT_EQ(block.ring_patch[ring], static_cast<std::int32_t>(i));
            EXPECT_EQ(block.ring_is_hole[ring], rings == &want.patch.inner ? 1 : 0);
            ASSERT_EQ(block.ring_size[ring], static_cast<std::int32_t>(want_ring.vertices.size()));
            for (std::size_t v = 0; v < want_ring.vertices.size(); ++v, ++vertex) {
              EXPECT_EQ(block.vertex_u[vertex], static_cast<float>(want_ring.vertices[v].x()));
              EXPECT_EQ(block.edge_type[vertex], static_cast<std::int8_t>(want_ring.edges[v]));
            }
            ++ring;
          }
        }
      }
    }
    EXPECT_EQ(next, map.patches.size());
  }
}

TEST(Convert, ViewsToo) {
  std::mt19937 random(3);
  mapping::SurfaceView view;
  view.view_id = 12;
  view.t_ref = time_from_ns(1'000'000);
  view.lines = 300;
  view.sensor_V = Vec3(0.25, 0.0, 0.75);
  for (std::uint32_t id = 1; id <= 500; ++id) { view.patches.push_back(sample_patch(random, id, 30)); }
  const auto chunks = to_view_messages(view, {});
  EXPECT_GT(chunks.size(), 1U);
  int patches = 0;
  for (const view_chunk_t& chunk : chunks) {
    EXPECT_LE(chunk.getEncodedSize(), static_cast<int>(kMaxMessageBytes));
    const view_chunk_t received = over_the_wire(chunk);
    EXPECT_EQ(received.view_id, 12);
    EXPECT_EQ(received.sensor_V[2], 0.75);
    patches += received.patches.npatches;
  }
  EXPECT_EQ(patches, 500);
}

TEST(Convert, AnEndlessBoundaryIsThinnedOut) {
  std::mt19937 random(3);
  mapping::SurfaceView view;
  view.patches.push_back(sample_patch(random, 1, 100'000));
  view.patches.push_back(sample_patch(random, 2, 5));
  for (int k = 0; k < 9000; ++k) { view.patches[0].inner.push_back(testing::sample_ring(random, 3)); }
  for (const view_chunk_t& chunk : to_view_messages(view, {})) {
    EXPECT_LE(chunk.getEncodedSize(), static_cast<int>(kMaxMessageBytes));
  }
}

}  // namespace
}  // namespace rosid::msgs
