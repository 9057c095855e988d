// What a line tells its chip: the set-up and the baud rate.

#include <fmt/format.h>

#include <utility>

#include "hal/io/usb_line.hpp"

namespace rosid::hal {

namespace {
constexpr unsigned kControlTimeout_ms = 1000;
}  // namespace

void UsbLine::plan_set_up(const FtdiRequest& baud) {
  // libusb_clear_halt() would wait for the chip's answer. What it does more is to have the kernel count packets from
  // zero as the chip does: without it the first packet may be taken for one that was there before. That costs a status
  // of the chip or a command of the session, which asks again.
  constexpr std::uint16_t kEndpointHalt = 0;
  const auto free = [this](bool& is_halted, unsigned char endpoint) {
    if (!std::exchange(is_halted, false)) { return; }
    set_up_.push_back({.request = {.request = LIBUSB_REQUEST_CLEAR_FEATURE,
                                   .value = kEndpointHalt,
                                   .index = endpoint,
                                   .is_optional = true},
                       .is_freeing = true});
  };
  free(slot_.is_in_halted, endpoints_.in);
  free(slot_.is_out_halted, endpoints_.out);
  for (const FtdiRequest& request : ftdi_set_up(chip_, interface_, baud)) { set_up_.push_back({.request = request}); }
}

bool UsbLine::tell(const Step& step) {
  constexpr auto kVendor = static_cast<std::uint8_t>(static_cast<unsigned>(LIBUSB_ENDPOINT_OUT) |
                                                     static_cast<unsigned>(LIBUSB_REQUEST_TYPE_VENDOR) |
                                                     static_cast<unsigned>(LIBUSB_RECIPIENT_DEVICE));
  constexpr auto kStandard = static_cast<std::uint8_t>(static_cast<unsigned>(LIBUSB_ENDPOINT_OUT) |
                                                       static_cast<unsigned>(LIBUSB_REQUEST_TYPE_STANDARD) |
                                                       static_cast<unsigned>(LIBUSB_RECIPIENT_ENDPOINT));
  const FtdiRequest& request = step.request;
  libusb_fill_control_setup(control_.bytes.data(), step.is_freeing ? kStandard : kVendor, request.request,
                            request.value, request.index, 0);
  libusb_fill_control_transfer(control_.handle.get(), handle_.get(), control_.bytes.data(), &UsbLine::on_told,
                               &control_, kControlTimeout_ms);
  return submit(control_);
}

void UsbLine::set_up_next() {
  if (set_up_at_ < set_up_.size()) {
    static_cast<void>(tell(set_up_[set_up_at_]));
    return;
  }
  phase_ = Phase::Running;
  for (Transfer& transfer : in_) { listen(transfer); }
}

void UsbLine::on_told(libusb_transfer* raw) {
  Transfer& transfer = *static_cast<Transfer*>(raw->user_data);
  transfer.is_in_flight = false;
  transfer.line->told();
}

void UsbLine::told() {
  if (phase_ == Phase::Closing || phase_ == Phase::Failed) { return; }
  const libusb_transfer_status status = control_.handle->status;
  const bool is_setting_up = phase_ == Phase::SettingUp;
  const bool is_refused = status == LIBUSB_TRANSFER_STALL;
  const bool is_good = status == LIBUSB_TRANSFER_COMPLETED;
  if (is_good || is_refused) { t_answer_ = clock_(); }
  if (status == LIBUSB_TRANSFER_NO_DEVICE) {
    fail(fmt::format("{} was unplugged", name_));
  } else if (!is_good && !(is_refused && is_setting_up && set_up_[set_up_at_].request.is_optional)) {
    ++counters_.transfer_errors;
    const int request = control_.bytes[1];
    fail(fmt::format("{} {} request {} of the set-up; unplug it and plug it in again", name_,
                     is_refused ? "refuses" : "does not answer", request));
  } else if (is_setting_up) {
    ++set_up_at_;
    set_up_next();
  }
}

Result<void> UsbLine::set_baud(int baud) {
  const auto request = ftdi_baud(chip_, interface_, baud);
  if (!request) { return make_error(ErrorCode::Unsupported, fmt::format("the chip cannot run at {} baud", baud)); }
  if (phase_ != Phase::Running || control_.is_in_flight) { return make_error(ErrorCode::Busy, "it is being set up"); }
  if (!tell({.request = *request})) { return make_error(ErrorCode::Io, why_failed_); }
  baud_ = baud;
  return {};
}

}  // namespace rosid::hal
