// Surface patches as chunks of at most 60 kB.

#include <algorithm>
#include <span>

#include "base/pose.hpp"
#include "msgs/convert.hpp"

namespace rosid::msgs {

namespace {

using mapping::Patch;
using mapping::Ring;

// Encoded sizes: what a patch, a ring and a vertex add to a message, and everything else with room to spare.
constexpr std::size_t kPatchBytes = 137;
constexpr std::size_t kRingBytes = 9;
constexpr std::size_t kVertexBytes = 9;
constexpr std::size_t kHeadBytes = 512;
constexpr std::size_t kBudget = kMaxMessageBytes - kHeadBytes;
constexpr std::size_t kLeastVertices = 3;

struct Size {
  std::size_t rings = 0;
  std::size_t vertices = 0;
  std::size_t bytes() const { return kPatchBytes + (kRingBytes * rings) + (kVertexBytes * vertices); }
};

Size size_of(const Patch& patch) {
  Size size;
  for (const auto* rings : {&patch.outer, &patch.inner}) {
    size.rings += rings->size();
    for (const Ring& ring : *rings) { size.vertices += ring.vertices.size(); }
  }
  return size;
}

/// Every how many-th vertex can be sent of a patch.
std::size_t stride_of(const Patch& patch) {
  Size size = size_of(patch);
  std::size_t stride = 1;
  const std::size_t all_vertices = size.vertices;
  while (size.bytes() > kBudget && size.vertices > 0) {
    ++stride;
    size.vertices = all_vertices / stride;
  }
  return stride;
}

std::size_t sent_bytes(const Patch& patch) {
  Size size = size_of(patch);
  size.vertices = (size.vertices / stride_of(patch)) + size.rings;
  return std::min(size.bytes(), kBudget);
}

std::size_t sent_bytes(const mapping::MapPatch& entry) {
  return sent_bytes(entry.patch);
}

/// Groups consecutive patches into messages. At least one group, which may be empty.
template <typename Entry>
std::vector<std::span<const Entry>> group(const std::vector<Entry>& entries) {
  std::vector<std::span<const Entry>> groups;
  std::size_t begin = 0;
  std::size_t bytes = 0;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const std::size_t more = sent_bytes(entries[k]);
    if (k > begin && bytes + more > kBudget) {
      groups.push_back(std::span(entries).subspan(begin, k - begin));
      begin = k;
      bytes = 0;
    }
    bytes += more;
  }
  groups.push_back(std::span(entries).subspan(begin));
  return groups;
}

void add_ring(patch_block_t& block, const Ring& ring, bool is_hole, std::size_t stride) {
  const std::size_t count = std::min(ring.vertices.size(), ring.edges.size());
  if ((count + stride - 1) / stride < kLeastVertices) { return; }
  std::int32_t sent = 0;
  for (std::size_t k = 0; k < count; k += stride) {
    block.vertex_u.push_back(static_cast<float>(ring.vertices[k].x()));
    block.vertex_v.push_back(static_cast<float>(ring.vertices[k].y()));
    block.edge_type.push_back(static_cast<std::int8_t>(ring.edges[k]));
    ++sent;
  }
  block.ring_patch.push_back(block.npatches);
  block.ring_is_hole.push_back(is_hole ? 1 : 0);
  block.ring_size.push_back(sent);
}

void add_patch(patch_block_t& block, const Patch& patch) {
  const std::size_t stride = stride_of(patch);
  for (const Ring& ring : patch.outer) { add_ring(block, ring, false, stride); }
  for (const Ring& ring : patch.inner) { add_ring(block, ring, true, stride); }
  const mapping::Plane& plane = patch.plane;
  block.id.push_back(static_cast<std::int32_t>(patch.id));
  block.pixel_count.push_back(patch.attributes.pixel_count);
  block.normal_x.push_back(plane.normal.x());
  block.normal_y.push_back(plane.normal.y());
  block.normal_z.push_back(plane.normal.z());
  block.axis_x.push_back(plane.e2.x());
  block.axis_y.push_back(plane.e2.y());
  block.axis_z.push_back(plane.e2.z());
  block.centroid_x.push_back(plane.centroid.x());
  block.centroid_y.push_back(plane.centroid.y());
  block.centroid_z.push_back(plane.centroid.z());
  const Mat3 covariance = plane.covariance();
  for (int row = 0; row < 3; ++row) {
    for (int column = row; column < 3; ++column) {
      block.covariance.push_back(static_cast<float>(covariance(row, column)));
    }
  }
  const mapping::PatchAttributes& attributes = patch.attributes;
  block.area_m2.push_back(static_cast<float>(attributes.area_m2));
  block.shape_factor.push_back(static_cast<float>(attributes.shape_factor));
  block.elongation_rad.push_back(static_cast<float>(attributes.elongation_rad));
  block.normal_cone_rad.push_back(static_cast<float>(attributes.normal_cone_rad));
  block.occlusion.push_back(static_cast<float>(attributes.occlusion));
  block.rms_m.push_back(static_cast<float>(attributes.rms_m));
  ++block.npatches;
}

void finish(patch_block_t& block) {
  block.nrings = static_cast<std::int32_t>(block.ring_size.size());
  block.nvertices = static_cast<std::int32_t>(block.vertex_u.size());
  block.ncovariance = static_cast<std::int32_t>(block.covariance.size());
}

}  // namespace

std::vector<view_chunk_t> to_view_messages(const mapping::SurfaceView& view, EpochOffset epoch) {
  const auto groups = group(view.patches);
  std::vector<view_chunk_t> messages;
  messages.reserve(groups.size());
  const Pose3 X_OV = to_pose3(view.X_OV_ref);
  for (const auto& entries : groups) {
    view_chunk_t message{};
    message.utime = epoch.utime(view.t_ref);
    message.view_id = static_cast<std::int32_t>(view.view_id);
    message.chunk = static_cast<std::int32_t>(messages.size());
    message.nchunks = static_cast<std::int32_t>(groups.size());
    message.patches_total = static_cast<std::int32_t>(view.patches.size());
    message.lines = view.lines;
    message.columns = view.columns;
    message.valid_pixels = view.valid_pixels;
    std::copy(X_OV.p_m.begin(), X_OV.p_m.end(), std::begin(message.position_OV));
    std::copy(X_OV.q_wxyz.begin(), X_OV.q_wxyz.end(), std::begin(message.orientation_OV));
    std::copy_n(view.sensor_V.data(), 3, std::begin(message.sensor_V));
    for (const Patch& patch : entries) { add_patch(message.patches, patch); }
    finish(message.patches);
    messages.push_back(std::move(message));
  }
  return messages;
}

std::vector<map_chunk_t> to_map_messages(const mapping::SurfaceMap& map, EpochOffset epoch) {
  const auto groups = group(map.patches);
  std::vector<map_chunk_t> messages;
  messages.reserve(groups.size());
  for (const auto& entries : groups) {
    map_chunk_t message{};
    message.utime = epoch.utime(map.t);
    message.version = static_cast<std::int64_t>(map.version);
    message.calibration_hash = static_cast<std::int64_t>(map.calibration_hash);
    message.chunk = static_cast<std::int32_t>(messages.size());
    message.nchunks = static_cast<std::int32_t>(groups.size());
    message.patches_total = static_cast<std::int32_t>(map.patches.size());
    message.views_fused = static_cast<std::int32_t>(map.views_fused);
    for (const mapping::MapPatch& entry : entries) {
      message.views.push_back(static_cast<std::int32_t>(entry.views));
      message.existence.push_back(static_cast<float>(entry.existence));
      const int flags = (entry.is_floor ? map_chunk_t::FLOOR : 0) | (entry.is_tentative ? map_chunk_t::TENTATIVE : 0);
      message.flags.push_back(static_cast<std::int8_t>(flags));
      add_patch(message.patches, entry.patch);
    }
    finish(message.patches);
    message.npatches = message.patches.npatches;
    messages.push_back(std::move(message));
  }
  return messages;
}

}  // namespace rosid::msgs
