// The laser's line as an FTDI adapter: libusb on the event loop, and the search for the adapter.

#include <libusb-1.0/libusb.h>
#include <sys/epoll.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "hal/io/support.hpp"
#include "hal/io/usb_line.hpp"

namespace rosid::hal {

namespace {

using UsbContext = std::unique_ptr<libusb_context, UsbReleaser<libusb_exit>>;

/// Has the descriptors of libusb watched and hands its events on. One line at a time.
class UsbOpener final : public ByteLineOpener, private EventHandler {
 public:
  UsbOpener(const HalConfig& config, EventLoop& loop, ByteLineOwner& owner, ClockFunction clock)
      : config_(config.laser),
        can_(config.can),
        ids_(parse_usb_ids(config.laser.usb_ids).value_or(std::vector<UsbId>{})),
        loop_(loop),
        owner_(owner),
        clock_(clock) {}
  ~UsbOpener() override { stop(); }
  UsbOpener(const UsbOpener&) = delete;
  UsbOpener& operator=(const UsbOpener&) = delete;

  Result<std::unique_ptr<ByteLine>> open() override;
  void step() override;

 private:
  Result<void> start();
  void stop();
  void on_event(std::uint32_t events) override;
  void handle_events();

  static void LIBUSB_CALL on_descriptor_added(int fd, short events, void* opener);
  static void LIBUSB_CALL on_descriptor_removed(int fd, void* opener);
  static int LIBUSB_CALL on_plugged(libusb_context* context, libusb_device* device, libusb_hotplug_event event,
                                    void* opener);

  LaserConfig config_;
  CanConfig can_;
  std::vector<UsbId> ids_;
  EventLoop& loop_;
  ByteLineOwner& owner_;
  ClockFunction clock_;
  UsbContext context_;
  std::vector<int> watched_;
  bool cannot_watch_ = false;
  bool has_own_timers_ = true;
  UsbLineSlot slot_;  // the owner has the line
};

void UsbOpener::on_descriptor_added(int fd, short events, void* opener) {
  auto& self = *static_cast<UsbOpener*>(opener);
  EventHandler& handler = self;
  // The bits of poll() and of epoll are the same.
  if (self.loop_.watch(fd, static_cast<std::uint32_t>(static_cast<unsigned short>(events)), handler)) {
    self.watched_.push_back(fd);
  } else {
    self.cannot_watch_ = true;
  }
}

void UsbOpener::on_descriptor_removed(int fd, void* opener) {
  auto& self = *static_cast<UsbOpener*>(opener);
  self.loop_.unwatch(fd);
  std::erase(self.watched_, fd);
}

int UsbOpener::on_plugged(libusb_context* /*context*/, libusb_device* device, libusb_hotplug_event /*event*/,
                          void* opener) {
  auto& self = *static_cast<UsbOpener*>(opener);
  libusb_device_descriptor descriptor{};
  if (libusb_get_device_descriptor(device, &descriptor) != 0) { return 0; }
  const bool is_wanted = std::any_of(self.ids_.begin(), self.ids_.end(), [&descriptor](const UsbId& id) {
    return id.vendor == descriptor.idVendor && id.product == descriptor.idProduct;
  });
  if (is_wanted) { self.owner_.on_line_arrival(); }
  return 0;  // keep it registered
}

Result<void> UsbOpener::start() {
  libusb_context* raw = nullptr;
  if (const int code = libusb_init(&raw); code != 0) {
    return make_error(ErrorCode::Io, std::string("no USB: ") + libusb_error_name(code));
  }
  context_.reset(raw);
  // Everything it would print comes back as a code.
  static_cast<void>(libusb_set_option(raw, LIBUSB_OPTION_LOG_LEVEL, LIBUSB_LOG_LEVEL_NONE));
  has_own_timers_ = libusb_pollfds_handle_timeouts(raw) != 0;
  const libusb_pollfd** descriptors = libusb_get_pollfds(raw);
  for (const libusb_pollfd** entry = descriptors; entry != nullptr && *entry != nullptr; ++entry) {
    on_descriptor_added((*entry)->fd, (*entry)->events, this);
  }
  libusb_free_pollfds(descriptors);
  libusb_set_pollfd_notifiers(raw, &UsbOpener::on_descriptor_added, &UsbOpener::on_descriptor_removed, this);
  // Where that is not possible the adapter is found at the next attempt.
  static_cast<void>(libusb_hotplug_register_callback(raw, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, 0,
                                                     LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY,
                                                     LIBUSB_HOTPLUG_MATCH_ANY, &UsbOpener::on_plugged, this, nullptr));
  return {};
}

void UsbOpener::stop() {
  if (!context_) { return; }
  libusb_set_pollfd_notifiers(context_.get(), nullptr, nullptr, nullptr);
  for (const int fd : watched_) { loop_.unwatch(fd); }
  watched_.clear();
  context_.reset();
}

Result<std::unique_ptr<ByteLine>> UsbOpener::open() {
  if (!context_) {
    if (auto started = start(); !started) { return tl::make_unexpected(started.error()); }
  }
  const auto adapter = choose_usb_adapter(list_usb_adapters(ids_), config_, usb_port_of(can_));
  if (!adapter) { return tl::make_unexpected(adapter.error()); }
  auto line = UsbLine::open(*adapter, config_, context_.get(), owner_, clock_, slot_);
  if (!line) { return tl::make_unexpected(line.error()); }
  if (std::exchange(cannot_watch_, false)) {
    return make_error(ErrorCode::Io, (*line)->name() + ": its descriptor cannot be watched");
  }
  return std::move(*line);
}

void UsbOpener::step() {
  if (context_ && !has_own_timers_) { handle_events(); }
  if (slot_.line != nullptr) { slot_.line->report_failure(); }
}

void UsbOpener::on_event(std::uint32_t /*events*/) {
  handle_events();
}

void UsbOpener::handle_events() {
  timeval no_wait{};
  static_cast<void>(libusb_handle_events_timeout_completed(context_.get(), &no_wait, nullptr));
  if (slot_.line != nullptr) { slot_.line->after_events(); }
}

}  // namespace

std::unique_ptr<ByteLineOpener> make_usb_opener(const HalConfig& config, EventLoop& loop, ByteLineOwner& owner,
                                                ClockFunction clock) {
  return std::make_unique<UsbOpener>(config, loop, owner, clock);
}

bool has_usb_support() {
  return true;
}

}  // namespace rosid::hal
