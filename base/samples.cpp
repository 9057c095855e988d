#include "base/samples.hpp"

namespace rosid {

const char* to_cstr(Aid aid) {
  switch (aid) {
    case Aid::Wheels: return "wheels";
    case Aid::Tilt: return "tilt";
    case Aid::SurfaceFix: return "surface_fix";
    case Aid::StandStill: return "stand_still";
  }
  return "unknown";
}

const char* to_cstr(AidOutcome outcome) {
  switch (outcome) {
    case AidOutcome::Fused: return "fused";
    case AidOutcome::FusedInflated: return "fused_inflated";
    case AidOutcome::RejectedGate: return "rejected_gate";
    case AidOutcome::Stale: return "stale";
    case AidOutcome::TooOld: return "too_old";
    case AidOutcome::Unusable: return "unusable";
    case AidOutcome::NotReady: return "not_ready";
    case AidOutcome::NumericFault: return "numeric_fault";
  }
  return "unknown";
}

}  // namespace rosid
