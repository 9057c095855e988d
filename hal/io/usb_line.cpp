#include "hal/io/usb_line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace rosid::hal {

namespace {

constexpr unsigned kOutTimeout_ms = 1000;
constexpr int kMostFailures = 16;
constexpr Duration kStillThere = std::chrono::seconds(1);
// Transmitter of the chip: a frame of the bus until it has the bytes.
constexpr Duration kFrame = std::chrono::milliseconds(1);
constexpr std::int64_t kBitsPerByte = 10;

Error usb_error(int code, const std::string& name) {
  switch (code) {
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND: return {ErrorCode::NotFound, fmt::format("{} was unplugged", name)};
    case LIBUSB_ERROR_ACCESS:
      return {ErrorCode::PermissionDenied,
              fmt::format("{} may not be opened by this user; {}", name, usb_permission_advice())};
    case LIBUSB_ERROR_BUSY:
      return {ErrorCode::Busy, fmt::format("{} is held by another program; end it, or name another adapter in "
                                           "laser.usb_serial",
                                           name)};
    case LIBUSB_ERROR_IO:
      return {ErrorCode::Io,
              fmt::format("{} cannot be used: LIBUSB_ERROR_IO (a service needs DeviceAllow=char-usb_device "
                          "rw)",
                          name)};
    default: return {ErrorCode::Io, fmt::format("{} cannot be used: {}", name, libusb_error_name(code))};
  }
}

Error unsupported(std::string what) {
  return {ErrorCode::Unsupported, std::move(what)};
}

}  // namespace

UsbLine::Endpoints UsbLine::find_endpoints(libusb_device* device, int interface) {
  Endpoints found;
  libusb_config_descriptor* config = nullptr;
  if (libusb_get_active_config_descriptor(device, &config) != 0) { return found; }
  const std::unique_ptr<libusb_config_descriptor, UsbReleaser<libusb_free_config_descriptor>> owner(config);
  if (interface >= config->bNumInterfaces || config->interface[interface].num_altsetting < 1) { return found; }
  const libusb_interface_descriptor& setting = config->interface[interface].altsetting[0];
  constexpr unsigned kTypeMask = 0x03;
  for (const libusb_endpoint_descriptor& endpoint : std::span(setting.endpoint, setting.bNumEndpoints)) {
    if ((endpoint.bmAttributes & kTypeMask) != LIBUSB_TRANSFER_TYPE_BULK) { continue; }
    if ((endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) == 0) {
      found.out = endpoint.bEndpointAddress;
    } else {
      found.in = endpoint.bEndpointAddress;
      found.packet_size = endpoint.wMaxPacketSize;
    }
  }
  return found;
}

Result<std::unique_ptr<UsbLine>> UsbLine::open(const UsbAdapter& adapter, const LaserConfig& config,
                                               libusb_context* context, ByteLineOwner& owner, ClockFunction clock,
                                               UsbLineSlot& slot) {
  const std::string name = describe(adapter);
  const auto chip = ftdi_chip(adapter.bcd_device);
  if (!chip) {
    return tl::make_unexpected(unsupported(fmt::format(
        "{}: unknown chip, release {:04x}; use the kernel's driver: laser.link = \"tty\"", name, adapter.bcd_device)));
  }
  if (config.usb_channel > ftdi_channels(*chip)) {
    return tl::make_unexpected(unsupported(fmt::format("{}: a {} has {} channels, laser.usb_channel is {}", name,
                                                       to_cstr(*chip), ftdi_channels(*chip), config.usb_channel)));
  }
  libusb_device** list = nullptr;
  const auto count = libusb_get_device_list(context, &list);
  if (count < 0) { return tl::make_unexpected(usb_error(static_cast<int>(count), name)); }
  libusb_device_handle* raw = nullptr;
  Endpoints endpoints;
  int code = LIBUSB_ERROR_NO_DEVICE;
  for (libusb_device* device : std::span(list, static_cast<std::size_t>(count))) {
    if (libusb_get_bus_number(device) != adapter.bus || libusb_get_device_address(device) != adapter.address) {
      continue;
    }
    endpoints = find_endpoints(device, config.usb_channel - 1);
    code = libusb_open(device, &raw);
  }
  libusb_free_device_list(list, 1);
  if (code != 0) { return tl::make_unexpected(usb_error(code, name)); }
  UsbHandle handle(raw);
  const bool is_plausible = endpoints.in != 0 && endpoints.out != 0 && endpoints.packet_size > 2 &&
                            kInSize % static_cast<std::size_t>(endpoints.packet_size) == 0;
  if (!is_plausible) {
    return tl::make_unexpected(unsupported(fmt::format("{} has not the endpoints of a serial adapter", name)));
  }
  std::unique_ptr<UsbLine> line(
      new UsbLine(std::move(handle), adapter, config, *chip, endpoints, context, owner, clock, slot));
  if (auto started = line->start(); !started) { return tl::make_unexpected(started.error()); }
  return line;
}

UsbLine::UsbLine(UsbHandle handle, const UsbAdapter& adapter, const LaserConfig& config, FtdiChip chip,
                 const Endpoints& endpoints, libusb_context* context, ByteLineOwner& owner, ClockFunction clock,
                 UsbLineSlot& slot)
    : handle_(std::move(handle)),
      name_(describe(adapter)),
      chip_(chip),
      interface_(config.usb_channel - 1),
      endpoints_(endpoints),
      context_(context),
      owner_(owner),
      clock_(clock),
      slot_(slot),
      packets_(static_cast<std::size_t>(endpoints.packet_size)),
      baud_(config.baud),
      in_(kInTransfers),
      out_(kOutTransfers) {
  slot_.line = this;
}

Result<void> UsbLine::start() {
  const auto baud = ftdi_baud(chip_, interface_, baud_);
  if (!baud) { return tl::make_unexpected(unsupported(fmt::format("{} cannot run at {} baud", name_, baud_))); }
  if (auto taken = take_interface(); !taken) { return taken; }
  plan_set_up(*baud);
  const auto prepare = [this](Transfer& transfer) {
    transfer.line = this;
    transfer.handle.reset(libusb_alloc_transfer(0));
    return transfer.handle != nullptr;
  };
  const bool is_ready = prepare(control_) && std::all_of(in_.begin(), in_.end(), prepare) &&
                        std::all_of(out_.begin(), out_.end(), prepare);
  if (!is_ready) { return tl::make_unexpected(usb_error(LIBUSB_ERROR_NO_MEM, name_)); }
  set_up_next();
  if (phase_ == Phase::Failed) { return make_error(ErrorCode::Io, why_failed_); }
  return {};
}

Result<void> UsbLine::take_interface() {
  // By hand: what libusb detaches by itself it attaches again by itself, also when the chip is mute. That there is no
  // driver is well, and what else is wrong the claim tells.
  static_cast<void>(libusb_detach_kernel_driver(handle_.get(), interface_));
  if (const int code = libusb_claim_interface(handle_.get(), interface_); code != 0) {
    return tl::make_unexpected(usb_error(code, name_));
  }
  return {};
}

bool UsbLine::may_give_back() const {
  const bool is_well = phase_ == Phase::SettingUp || phase_ == Phase::Running;
  // A chip with nothing to say says so each millisecond.
  return is_well && t_answer_ && clock_() - *t_answer_ <= kStillThere;
}

UsbLine::~UsbLine() {
  slot_.line = nullptr;
  const bool gives_back = may_give_back();
  phase_ = Phase::Closing;
  cancel_all();
  // A cancelled transfer comes back as an event; the kernel does that at once.
  constexpr int kRounds = 50;
  for (int k = 0; k < kRounds && is_under_way(); ++k) {
    timeval patience{.tv_sec = 0, .tv_usec = 10'000};
    static_cast<void>(libusb_handle_events_timeout_completed(context_, &patience, nullptr));
  }
  static_cast<void>(libusb_release_interface(handle_.get(), interface_));
  if (gives_back) { static_cast<void>(libusb_attach_kernel_driver(handle_.get(), interface_)); }
  // Before the transfers: whatever the kernel has not given back by now, it forgets.
  handle_.reset();
}

bool UsbLine::is_under_way() const {
  const auto is_flying = [](const Transfer& transfer) { return transfer.is_in_flight; };
  return control_.is_in_flight || std::any_of(in_.begin(), in_.end(), is_flying) ||
         std::any_of(out_.begin(), out_.end(), is_flying);
}

void UsbLine::cancel_all() {
  const auto cancel = [](Transfer& transfer) {
    if (transfer.is_in_flight) { static_cast<void>(libusb_cancel_transfer(transfer.handle.get())); }
  };
  cancel(control_);
  std::for_each(in_.begin(), in_.end(), cancel);
  std::for_each(out_.begin(), out_.end(), cancel);
}

void UsbLine::fail(std::string why) {
  if (phase_ == Phase::Failed || phase_ == Phase::Closing) { return; }
  why_failed_ = std::move(why);
  phase_ = Phase::Failed;
}

bool UsbLine::submit(Transfer& transfer) {
  const int code = libusb_submit_transfer(transfer.handle.get());
  transfer.is_in_flight = code == 0;
  if (code != 0) {
    fail(code == LIBUSB_ERROR_NO_DEVICE
             ? usb_error(code, name_).message
             : fmt::format("{} was lost: the kernel refuses a transfer: {}", name_, libusb_error_name(code)));
  }
  return code == 0;
}

// --- to the device

IoResult UsbLine::write(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) { return {IoStatus::Done, 0, 0}; }
  // Also when it has failed: the owner is told with the reason (report_failure()).
  if (phase_ != Phase::Running || control_.is_in_flight) { return {IoStatus::WouldBlock, 0, 0}; }
  const auto free =
      std::find_if(out_.begin(), out_.end(), [](const Transfer& transfer) { return !transfer.is_in_flight; });
  if (free == out_.end()) { return {IoStatus::WouldBlock, 0, 0}; }
  const auto part = bytes.first(std::min(bytes.size(), kOutSize));
  std::copy(part.begin(), part.end(), free->bytes.begin());
  libusb_fill_bulk_transfer(free->handle.get(), handle_.get(), endpoints_.out, free->bytes.data(),
                            static_cast<int>(part.size()), &UsbLine::on_sent, &*free, kOutTimeout_ms);
  if (!submit(*free)) { return {IoStatus::WouldBlock, 0, 0}; }
  return {IoStatus::Done, part.size(), 0};
}

bool UsbLine::is_drained(Time now) const {
  const bool is_sending =
      std::any_of(out_.begin(), out_.end(), [](const Transfer& transfer) { return transfer.is_in_flight; });
  return !is_sending && !control_.is_in_flight && now >= t_line_free_;
}

void UsbLine::on_sent(libusb_transfer* raw) {
  Transfer& transfer = *static_cast<Transfer*>(raw->user_data);
  transfer.is_in_flight = false;
  transfer.line->sent(transfer);
}

void UsbLine::sent(Transfer& transfer) {
  if (phase_ != Phase::Running) { return; }
  if (transfer.handle->status == LIBUSB_TRANSFER_STALL) {
    fail_halted(false);
    return;
  }
  if (transfer.handle->status != LIBUSB_TRANSFER_COMPLETED) {
    // What was lost the laser's session sends again.
    static_cast<void>(count_failure(transfer.handle->status));
    return;
  }
  // The chip has the bytes now; the line is busy with them from now on.
  const Duration on_line{transfer.handle->actual_length * kBitsPerByte * 1'000'000'000 / std::max(baud_, 1)};
  t_line_free_ = std::max(t_line_free_, clock_()) + on_line + kFrame;
}

// --- from the device

void UsbLine::listen(Transfer& transfer) {
  libusb_fill_bulk_transfer(transfer.handle.get(), handle_.get(), endpoints_.in, transfer.bytes.data(),
                            static_cast<int>(transfer.bytes.size()), &UsbLine::on_received, &transfer, 0);
  if (phase_ == Phase::Running) { static_cast<void>(submit(transfer)); }
}

void UsbLine::on_received(libusb_transfer* raw) {
  Transfer& transfer = *static_cast<Transfer*>(raw->user_data);
  transfer.is_in_flight = false;
  transfer.line->receive(transfer);
}

void UsbLine::receive(Transfer& transfer) {
  if (phase_ != Phase::Running) { return; }
  const libusb_transfer_status status = transfer.handle->status;
  // Also with what a transfer had got before it went wrong.
  const auto size = static_cast<std::size_t>(std::max(transfer.handle->actual_length, 0));
  const auto bytes = packets_.unpack(std::span(transfer.bytes).first(std::min(size, transfer.bytes.size())));
  if (!is_told_) {
    is_told_ = true;
    owner_.on_line_open(clock_());
  }
  if (!bytes.empty()) { owner_.on_line_bytes(clock_(), bytes); }
  if (status == LIBUSB_TRANSFER_STALL) {
    fail_halted(true);
    return;
  }
  if (status == LIBUSB_TRANSFER_COMPLETED) {
    failures_in_a_row_ = 0;
    t_answer_ = clock_();
  }
  if (status == LIBUSB_TRANSFER_COMPLETED || count_failure(status)) { listen(transfer); }
}

bool UsbLine::count_failure(libusb_transfer_status status) {
  if (status == LIBUSB_TRANSFER_NO_DEVICE) {
    fail(fmt::format("{} was unplugged", name_));
    return false;
  }
  ++counters_.transfer_errors;
  if (++failures_in_a_row_ >= kMostFailures) {
    fail(fmt::format("{} was lost: {} transfers failed one after the other; check its plug and cable", name_,
                     failures_in_a_row_));
    return false;
  }
  return true;
}

/// One fault, though the transfers queued behind it come back in the same way.
void UsbLine::fail_halted(bool is_in) {
  ++counters_.stalls;
  (is_in ? slot_.is_in_halted : slot_.is_out_halted) = true;
  fail(fmt::format("{} was lost: it halted the endpoint {}; it is opened anew", name_,
                   is_in ? "it sends by" : "it receives by"));
}

void UsbLine::after_events() {
  if (phase_ == Phase::Running && !is_told_) {
    is_told_ = true;
    owner_.on_line_open(clock_());
  }
  // The last calls: the owner may have destroyed the line.
  if (phase_ == Phase::Failed) {
    report_failure();
  } else {
    owner_.on_line_event(clock_());
  }
}

void UsbLine::report_failure() {
  if (phase_ == Phase::Failed) { owner_.on_line_lost(clock_(), why_failed_); }
}

ByteLine::Counters UsbLine::counters() const {
  Counters all = counters_;
  all.overruns = packets_.counters().overruns;
  all.parity_errors = packets_.counters().parity_errors;
  all.framing_errors = packets_.counters().framing_errors;
  all.breaks = packets_.counters().breaks;
  return all;
}

}  // namespace rosid::hal
