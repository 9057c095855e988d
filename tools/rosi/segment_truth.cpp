#include "tools/rosi/segment_truth.hpp"

#include <fmt/core.h>

#include <utility>

#include "tools/rosi/run_files.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

/// Before and after its way the vehicle stands; no simulated drive waits longer.
constexpr double kLongestRest_s = 60.0;

fs::path beside(const fs::path& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).parent_path() / "truth.tum";
}

}  // namespace

Result<TruthSource> TruthSource::of_drive(const fs::path& labels, const fs::path& trajectory) {
  auto opened = TruthLabels::open(labels);
  if (!opened) { return tl::unexpected<Error>(opened.error()); }
  TruthSource source;
  const fs::path file = trajectory.empty() ? beside(labels) : trajectory;
  auto poses = read_trajectory(file);
  if (!poses) {
    return make_error(poses.error().code,
                      fmt::format("{}; name the drive's true way with --trajectory FILE", poses.error().message));
  }
  source.name_ = file.string();
  if (poses->empty()) { return make_error(ErrorCode::Format, fmt::format("'{}' holds no pose", source.name_)); }
  source.labels_ = std::move(*opened);
  source.trajectory_ = std::move(*poses);
  return source;
}

Result<TruthSource> TruthSource::of_scan(const fs::path& pcd) {
  auto ids = read_intensity_labels(pcd);
  if (!ids) { return tl::unexpected<Error>(ids.error()); }
  TruthSource source;
  source.name_ = pcd.string();
  source.ids_ = std::move(*ids);
  return source;
}

Result<RigidTransform> TruthSource::pose_at(const mapping::RangeImage& image) const {
  const StampedPose& first = trajectory_.poses().front();
  const StampedPose& last = trajectory_.poses().back();
  const Duration rest = duration_from_s(kLongestRest_s);
  if (image.t_ref < first.t - rest || image.t_ref > last.t + rest) {
    return make_error(ErrorCode::Format,
                      fmt::format("'{}' goes from {:.1f} s to {:.1f} s and says nothing of view {} at {:.1f} s; name "
                                  "the way of this drive with --trajectory FILE",
                                  name_, to_s(first.t), to_s(last.t), image.view_id, to_s(image.t_ref)));
  }
  if (image.t_ref < first.t) { return first.X; }
  return image.t_ref > last.t ? last.X : trajectory_.at(image.t_ref);
}

Result<ViewTruth> TruthSource::at(const mapping::RangeImage& image) const {
  ViewTruth truth;
  if (!labels_) {
    if (ids_.size() != image.size()) {
      return make_error(ErrorCode::Format,
                        fmt::format("'{}': {} intensities for {} pixels", name_, ids_.size(), image.size()));
    }
    truth.surface = ids_;
    return truth;
  }
  auto surfaces = labels_->surfaces_of(image);
  if (!surfaces) { return tl::unexpected<Error>(surfaces.error()); }
  const auto pose = pose_at(image);
  if (!pose) { return tl::unexpected<Error>(pose.error()); }
  truth.surface = std::move(*surfaces);
  truth.X_WV = *pose;
  truth.shapes = labels_->surfaces();
  return truth;
}

}  // namespace rosid::rosi
