#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "msgs/bytes.hpp"
#include "msgs/crc32c.hpp"
#include "msgs/map_file.hpp"

namespace rosid::msgs {

namespace {

using mapping::EdgeType;
using mapping::MapPatch;
using mapping::PatchAttributes;
using mapping::Plane;
using mapping::Ring;
using mapping::SurfaceMap;

constexpr std::array<std::uint8_t, 8> kMagic{'R', 'O', 'S', 'I', 'M', 'A', 'P', 0x1A};
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kFileHeaderSize = 20;

constexpr std::uint32_t block_type(std::string_view name) {
  std::uint32_t type = 0;
  for (unsigned k = 0; k < name.size(); ++k) {
    type |= static_cast<std::uint32_t>(static_cast<unsigned char>(name[k])) << (8U * k);
  }
  return type;
}
constexpr std::uint32_t kBlockMeta = block_type("META");
constexpr std::uint32_t kBlockPatch = block_type("PTCH");
constexpr std::uint32_t kBlockEnd = block_type("END ");

void put_vector(MapWriter& out, const Vec3& v) {
  for (int k = 0; k < 3; ++k) { out.put(v[k]); }
}
void put_matrix(MapWriter& out, const Mat3& m) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) { out.put(m(row, column)); }
  }
}

void put_plane(MapWriter& out, const Plane& plane) {
  put_vector(out, plane.normal);
  put_vector(out, plane.e2);
  put_vector(out, plane.e3);
  put_vector(out, plane.centroid);
  put_matrix(out, plane.covariance_independent);
  put_matrix(out, plane.covariance_correlated);
}

void put_rings(MapWriter& out, const std::vector<Ring>& rings) {
  out.put(static_cast<std::uint32_t>(rings.size()));
  for (const Ring& ring : rings) {
    out.put(static_cast<std::uint32_t>(ring.vertices.size()));
    for (const Vec2& vertex : ring.vertices) {
      out.put(vertex.x());
      out.put(vertex.y());
    }
    out.put(static_cast<std::uint32_t>(ring.edges.size()));
    for (const EdgeType edge : ring.edges) { out.put(static_cast<std::uint8_t>(edge)); }
  }
}

void put_attributes(MapWriter& out, const PatchAttributes& attributes) {
  out.put(attributes.area_m2);
  out.put(attributes.shape_factor);
  out.put(attributes.elongation_rad);
  out.put_all<float>(attributes.curvature_histogram);
  out.put(attributes.normal_cone_rad);
  out.put(attributes.occlusion);
  out.put(attributes.rms_m);
  out.put(static_cast<std::int32_t>(attributes.pixel_count));
}

void put_patch(MapWriter& out, const MapPatch& entry) {
  out.put(entry.patch.id);
  out.put(entry.views);
  out.put(to_ns(entry.t_first));
  out.put(to_ns(entry.t_last));
  out.put(entry.existence);
  out.put(static_cast<std::uint8_t>((entry.is_floor ? 1U : 0U) | (entry.is_tentative ? 2U : 0U)));
  put_plane(out, entry.patch.plane);
  put_attributes(out, entry.patch.attributes);
  put_rings(out, entry.patch.outer);
  put_rings(out, entry.patch.inner);
}

void append_block(std::vector<std::uint8_t>& file, std::uint32_t type, std::span<const std::uint8_t> payload) {
  MapWriter out(file);
  const std::size_t begin = file.size();
  out.put(type);
  out.put(static_cast<std::uint64_t>(payload.size()));
  out.put_bytes(payload);
  out.put(crc32c(std::span<const std::uint8_t>(file).subspan(begin)));
}

// ---------------------------------------------------------------------------------------------------------- reading

Vec3 get_vector(MapReader& in) {
  Vec3 v;
  for (int k = 0; k < 3; ++k) { v[k] = in.get<double>(); }
  return v;
}
Mat3 get_matrix(MapReader& in) {
  Mat3 m;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) { m(row, column) = in.get<double>(); }
  }
  return m;
}

bool get_plane(MapReader& in, Plane& plane) {
  plane.normal = get_vector(in);
  plane.e2 = get_vector(in);
  plane.e3 = get_vector(in);
  plane.centroid = get_vector(in);
  plane.covariance_independent = get_matrix(in);
  plane.covariance_correlated = get_matrix(in);
  const bool is_finite = plane.normal.allFinite() && plane.e2.allFinite() && plane.e3.allFinite() &&
                         plane.centroid.allFinite() && plane.covariance_independent.allFinite() &&
                         plane.covariance_correlated.allFinite();
  Mat3 axes;
  axes << plane.e2, plane.e3, plane.normal;
  constexpr double kOrthonormalTolerance = 1e-6;
  return is_finite && (axes.transpose() * axes - Mat3::Identity()).cwiseAbs().maxCoeff() < kOrthonormalTolerance;
}

bool get_rings(MapReader& in, std::vector<Ring>& rings) {
  constexpr std::size_t kLeastRing = 8;
  constexpr std::size_t kVertexSize = 16;
  const auto count = in.get<std::uint32_t>();
  if (count > in.remaining() / kLeastRing) { return false; }
  rings.resize(count);
  for (Ring& ring : rings) {
    const auto vertices = in.get<std::uint32_t>();
    if (vertices > in.remaining() / kVertexSize) { return false; }
    ring.vertices.resize(vertices);
    for (Vec2& vertex : ring.vertices) {
      vertex.x() = in.get<double>();
      vertex.y() = in.get<double>();
      if (!vertex.allFinite()) { return false; }
    }
    const auto edges = in.get<std::uint32_t>();
    if (edges > in.remaining()) { return false; }
    ring.edges.resize(edges);
    for (EdgeType& edge : ring.edges) {
      const auto value = in.get<std::uint8_t>();
      if (value > static_cast<std::uint8_t>(EdgeType::NoData)) { return false; }
      edge = static_cast<EdgeType>(value);
    }
  }
  return true;
}

void get_attributes(MapReader& in, PatchAttributes& attributes) {
  attributes.area_m2 = in.get<double>();
  attributes.shape_factor = in.get<double>();
  attributes.elongation_rad = in.get<double>();
  in.get_all<float>(attributes.curvature_histogram);
  attributes.normal_cone_rad = in.get<double>();
  attributes.occlusion = in.get<double>();
  attributes.rms_m = in.get<double>();
  attributes.pixel_count = in.get<std::int32_t>();
}

/// False: the values cannot be a patch.
bool get_patch(MapReader& in, MapPatch& entry) {
  entry.patch.id = in.get<std::uint32_t>();
  entry.views = in.get<std::uint32_t>();
  entry.t_first = time_from_ns(in.get<std::int64_t>());
  entry.t_last = time_from_ns(in.get<std::int64_t>());
  entry.existence = in.get<double>();
  const auto flags = in.get<std::uint8_t>();
  entry.is_floor = (flags & 1U) != 0;
  entry.is_tentative = (flags & 2U) != 0;
  if (!get_plane(in, entry.patch.plane)) { return false; }
  get_attributes(in, entry.patch.attributes);
  return get_rings(in, entry.patch.outer) && get_rings(in, entry.patch.inner) && in.is_complete() &&
         std::isfinite(entry.existence) && std::isfinite(entry.patch.attributes.area_m2);
}

struct Block {
  std::uint32_t type = 0;
  std::span<const std::uint8_t> payload;
};

tl::unexpected<Error> broken_block(int number, std::size_t offset, std::string_view what) {
  return make_error(ErrorCode::Format, fmt::format("block {} at byte {}: {}", number, offset, what));
}

Result<Block> next_block(MapReader& in, std::span<const std::uint8_t> file, int number) {
  const std::size_t begin = in.position();
  Block block;
  block.type = in.get<std::uint32_t>();
  const auto length = in.get<std::uint64_t>();
  if (in.failed() || length > in.remaining()) { return broken_block(number, begin, "cut off or its length is wrong"); }
  block.payload = in.get_bytes(static_cast<std::size_t>(length));
  const std::size_t end = in.position();
  const auto checksum = in.get<std::uint32_t>();
  if (in.failed()) { return broken_block(number, begin, "cut off"); }
  if (checksum != crc32c(file.subspan(begin, end - begin))) { return broken_block(number, begin, "wrong checksum"); }
  return block;
}

/// Patch count the file announces.
Result<std::uint32_t> read_meta(const Block& block, SurfaceMap& map, std::size_t offset) {
  MapReader in(block.payload);
  map.version = in.get<std::uint64_t>();
  map.next_id = in.get<std::uint32_t>();
  map.views_fused = in.get<std::uint32_t>();
  map.t = time_from_ns(in.get<std::int64_t>());
  const auto count = in.get<std::uint32_t>();
  if (!in.is_complete()) { return broken_block(0, offset, "META has the wrong size"); }
  return count;
}

Result<void> check_header(MapReader& in, std::span<const std::uint8_t> bytes, SurfaceMap& map) {
  const auto magic = in.get_bytes(kMagic.size());
  if (in.failed() || !std::equal(magic.begin(), magic.end(), kMagic.begin())) {
    return make_error(ErrorCode::Format, "this is not a rosid map: the first bytes are not its magic");
  }
  const auto version = in.get<std::uint32_t>();
  map.calibration_hash = in.get<std::uint64_t>();
  const auto checksum = in.get<std::uint32_t>();
  if (in.failed()) { return make_error(ErrorCode::Format, "the header is cut off"); }
  if (checksum != crc32c(bytes.first(kFileHeaderSize))) {
    return make_error(ErrorCode::Format, "the header has a wrong checksum");
  }
  if (version != kVersion) {
    return make_error(ErrorCode::Version,
                      fmt::format("the map has format version {}; this program reads version {}", version, kVersion));
  }
  return {};
}

}  // namespace

std::vector<std::uint8_t> serialize_map(const SurfaceMap& map) {
  std::vector<std::uint8_t> file;
  MapWriter out(file);
  out.put_bytes(kMagic);
  out.put(kVersion);
  out.put(map.calibration_hash);
  out.put(crc32c(file));

  std::vector<std::uint8_t> payload;
  MapWriter body(payload);
  body.put(map.version);
  body.put(map.next_id);
  body.put(map.views_fused);
  body.put(to_ns(map.t));
  body.put(static_cast<std::uint32_t>(map.patches.size()));
  append_block(file, kBlockMeta, payload);
  for (const MapPatch& entry : map.patches) {
    payload.clear();
    put_patch(body, entry);
    append_block(file, kBlockPatch, payload);
  }
  append_block(file, kBlockEnd, {});
  return file;
}

Result<SurfaceMap> deserialize_map(std::span<const std::uint8_t> bytes) {
  SurfaceMap map;
  MapReader in(bytes);
  if (auto header = check_header(in, bytes, map); !header) { return tl::unexpected(header.error()); }
  std::uint32_t announced = 0;
  for (int number = 0;; ++number) {
    const std::size_t offset = in.position();
    const auto block = next_block(in, bytes, number);
    if (!block) { return tl::unexpected(block.error()); }
    if ((number == 0) != (block->type == kBlockMeta)) {
      return broken_block(number, offset, "META must be the first block and the only one of its kind");
    }
    if (block->type == kBlockMeta) {
      const auto count = read_meta(*block, map, offset);
      if (!count) { return tl::unexpected(count.error()); }
      announced = *count;
    } else if (block->type == kBlockPatch) {
      MapPatch entry;
      MapReader payload(block->payload);
      if (!get_patch(payload, entry)) { return broken_block(number, offset, "these values cannot be a patch"); }
      if (!map.patches.empty() && map.patches.back().patch.id >= entry.patch.id) {
        return broken_block(number, offset, "patch ids do not grow");
      }
      map.patches.push_back(std::move(entry));
    } else if (block->type == kBlockEnd) {
      break;
    }  // other blocks are from a later minor extension and can be skipped
  }
  if (in.remaining() != 0) { return make_error(ErrorCode::Format, "there are bytes behind the END block"); }
  if (map.patches.size() != announced) {
    return make_error(ErrorCode::Format,
                      fmt::format("the map announces {} patches but holds {}", announced, map.patches.size()));
  }
  return map;
}

}  // namespace rosid::msgs
