#include "daemon/mapping_stage.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include "base/pose.hpp"

namespace rosid::daemon {

namespace {

// A view's reference time is at most one half turn (10 s) plus the processing of the view before it ago.
constexpr std::size_t kHistoryTicks = 2400;

}  // namespace

PoseEstimate prior_from(const PoseEstimate& emitted, const PoseEstimate& known) {
  if (known.fixes_applied == emitted.fixes_applied) { return emitted; }
  PoseEstimate prior = emitted;
  const RigidTransform X_OVref = to_transform(emitted.X_OV);
  const RigidTransform X_WV_now = to_transform(known.X_WV);
  prior.X_WO = known.X_WO;
  prior.X_WV = to_pose3(to_transform(known.X_WO) * X_OVref);
  prior.fixes_applied = known.fixes_applied;
  prior.status = known.status;
  // p_ref = p_now + R_now d and R_ref = R_now R_rel, so dp_ref = dp_now - R_now [d]x dtheta_now and
  // dtheta_ref = R_rel^T dtheta_now.
  const RigidTransform X_now_ref = to_transform(known.X_OV).inverse() * X_OVref;
  Mat6 J = Mat6::Identity();
  J.topRightCorner<3, 3>() = -X_WV_now.rotation() * skew(X_now_ref.p);
  J.bottomRightCorner<3, 3>() = X_now_ref.rotation().transpose();
  const Mat6 P = J * to_mat6(known.covariance_W) * J.transpose();
  prior.covariance_W = to_flat(0.5 * (P + P.transpose()));
  return prior;
}

MappingStage::MappingStage(const mapping::MappingConfig& config, const Calibration& calibration,
                           mapping::Stopwatch stopwatch, ImageObserver observer)
    : assembler_(config.assembler, calibration),
      reducer_(config.segmenter, calibration),
      mapper_(config, calibration, stopwatch),
      stopwatch_(std::move(stopwatch)),
      observer_(std::move(observer)) {}

void MappingStage::add(const TrackedPose& pose) {
  assembler_.add(pose.estimate);
  history_.push_back(pose);
  if (history_.size() > kHistoryTicks) { history_.pop_front(); }
}

bool MappingStage::fetch() {
  std::optional<mapping::RangeImage> image = assembler_.take();
  if (!image.has_value()) { return false; }
  if (observer_) { observer_(*image); }
  const double begin_s = stopwatch_();
  Pending pending;
  pending.t_complete = image->t_ref;
  for (const mapping::LineInfo& line : image->line) { pending.t_complete = std::max(pending.t_complete, line.t); }
  pending.view = std::make_shared<const mapping::SurfaceView>(reducer_.reduce(*image));
  pending.segment_s = stopwatch_() - begin_s;
  pending_ = std::move(pending);
  return true;
}

const TrackedPose* MappingStage::known_for(const Pending& pending) const {
  const auto found = std::ranges::find_if(history_, [&](const TrackedPose& pose) {
    return pose.estimate.t >= pending.t_complete && pose.fixes_handled >= fixes_issued_;
  });
  return found == history_.end() ? nullptr : &*found;
}

const TrackedPose* MappingStage::emitted_at(Time t) const {
  const auto found = std::ranges::lower_bound(history_, t, {}, [](const TrackedPose& pose) { return pose.estimate.t; });
  return found == history_.end() || found->estimate.t != t ? nullptr : &*found;
}

std::optional<ViewResult> MappingStage::process() {
  try {
    for (;;) {
      if (!pending_.has_value()) { static_cast<void>(fetch()); }
      if (!pending_.has_value()) { return std::nullopt; }
      const TrackedPose* known = known_for(*pending_);
      if (known == nullptr) { return std::nullopt; }
      const Pending view = std::move(*pending_);
      pending_.reset();
      const TrackedPose* emitted = emitted_at(view.view->t_ref);
      if (emitted == nullptr) {
        ++counters_.failed;
        continue;
      }
      ViewResult result;
      result.view = view.view;
      result.t_complete = view.t_complete;
      result.t_released = known->estimate.t;
      result.segment_s = view.segment_s;
      result.prior = prior_from(emitted->estimate, known->estimate);
      result.update = mapper_.process(*view.view, result.prior);
      if (result.update.fix.has_value()) { ++fixes_issued_; }
      ++counters_.views;
      return result;
    }
  } catch (const std::exception&) {
    pending_.reset();
    ++counters_.failed;
    return std::nullopt;
  }
}

}  // namespace rosid::daemon
