#include "tests/unit/hal/usb_bus.hpp"

#include <fmt/format.h>
#include <linux/ioctl.h>
#include <sys/socket.h>
#include <umockdev.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <span>

namespace rosid::hal::test {

namespace {

int fail(int code) {
  errno = code;
  return -1;
}

std::vector<std::uint8_t> descriptors(const UsbAdapterModel::Kind& kind) {
  const auto low = [](int word) { return static_cast<std::uint8_t>(word & 0xFF); };
  const auto high = [](int word) { return static_cast<std::uint8_t>(word >> 8); };
  const int total = 9 + (kind.channels * (9 + 7 + 7));
  std::vector<std::uint8_t> all{18, 1, 0, 2, 0, 0, 0, 8, low(kind.vendor), high(kind.vendor), low(kind.product),
                                high(kind.product), low(kind.bcd_device), high(kind.bcd_device), 1, 2, 3, 1,
                                // Configuration.
                                9, 2, low(total), high(total), low(kind.channels), 1, 0, 0xA0, 45};
  for (int k = 0; k < kind.channels; ++k) {
    all.insert(all.end(), {9, 4, low(k), 0, 2, 0xFF, 0xFF, 0xFF, 2});
    all.insert(all.end(), {7, 5, low(0x81 + (2 * k)), 2, low(kind.packet_size), high(kind.packet_size), 0});
    all.insert(all.end(), {7, 5, low(0x02 + (2 * k)), 2, low(kind.packet_size), high(kind.packet_size), 0});
  }
  return all;
}

}  // namespace

std::atomic<UsbBus*>& UsbBus::current() {
  static std::atomic<UsbBus*> bus = nullptr;
  return bus;
}

UsbBus::UsbBus() : testbed_(umockdev_testbed_new()) {
  current() = this;
}

UsbBus::~UsbBus() {
  current() = nullptr;
  g_object_unref(testbed_);
}

void UsbBus::add(UsbAdapterModel& adapter) {
  const std::scoped_lock lock(mutex_);
  adapters_.push_back(&adapter);
}

void UsbBus::remove(UsbAdapterModel& adapter) {
  const std::scoped_lock lock(mutex_);
  std::erase(adapters_, &adapter);
}

UsbAdapterModel* UsbBus::with_node(const std::string& path) const {
  const std::scoped_lock lock(mutex_);
  const auto found = std::find_if(adapters_.begin(), adapters_.end(),
                                  [&path](const auto* adapter) { return adapter->node() == path; });
  return found == adapters_.end() ? nullptr : *found;
}

UsbAdapterModel* UsbBus::with_descriptor(int fd) const {
  const std::scoped_lock lock(mutex_);
  const auto found =
      std::find_if(adapters_.begin(), adapters_.end(), [fd](const auto* adapter) { return adapter->has(fd); });
  return found == adapters_.end() ? nullptr : *found;
}

UsbAdapterModel::UsbAdapterModel(UsbBus& bus, Kind kind) : bus_(bus), kind_(std::move(kind)) {
  laser.config[lms::config_offset::kMeasuringMode] = lms::kMode32m;
  laser.config[lms::config_offset::kAvailability] = lms::kAvailabilityIndices;
  bus_.add(*this);
}

UsbAdapterModel::~UsbAdapterModel() {
  bus_.remove(*this);
}

std::string UsbAdapterModel::node() const {
  return fmt::format("/dev/bus/usb/001/{:03}", address_);
}

void UsbAdapterModel::plug() {
  address_ = bus_.next_address();
  const auto hex = [](int word) { return fmt::format("{:04x}", word); };
  const std::string address = std::to_string(address_);
  const std::vector<std::pair<std::string, std::string>> attributes{{"busnum", "1"},
                                                                    {"devnum", address},
                                                                    {"idVendor", hex(kind_.vendor)},
                                                                    {"idProduct", hex(kind_.product)},
                                                                    {"bcdDevice", hex(kind_.bcd_device)},
                                                                    {"serial", kind_.serial},
                                                                    {"speed", kind_.packet_size > 64 ? "480" : "12"},
                                                                    {"bConfigurationValue", "1"}};
  std::vector<std::string> texts;
  for (const auto& [key, value] : attributes) { texts.insert(texts.end(), {key, value + "\n"}); }
  std::vector<char*> pointers;
  for (std::string& text : texts) { pointers.push_back(text.data()); }
  pointers.push_back(nullptr);
  std::array<std::string, 8> properties{"DEVTYPE", "usb_device", "DEVNAME", node(), "BUSNUM", "001", "DEVNUM", address};
  std::vector<char*> property_pointers;
  for (std::string& text : properties) { property_pointers.push_back(text.data()); }
  property_pointers.push_back(nullptr);
  char* path = umockdev_testbed_add_devicev(bus_.testbed(), "usb", kind_.port.c_str(), nullptr, pointers.data(),
                                            property_pointers.data());
  sysfs_path_ = path;
  g_free(path);
  std::vector<std::uint8_t> bytes = descriptors(kind_);
  umockdev_testbed_set_attribute_binary(bus_.testbed(), sysfs_path_.c_str(), "descriptors", bytes.data(),
                                        static_cast<gint>(bytes.size()));
  is_plugged_ = true;
  has_kernel_driver = true;
  claimed = -1;
  umockdev_testbed_uevent(bus_.testbed(), sysfs_path_.c_str(), "add");
}

void UsbAdapterModel::unplug() {
  is_plugged_ = false;
  while (!pending_.empty()) { finish(*pending_.front(), -ESHUTDOWN, 0); }
  // With something unread in it a closed socket is an error on the other side, as the node of a lost device is.
  set_ready(false);
  kernel_end_.reset();
  umockdev_testbed_uevent(bus_.testbed(), sysfs_path_.c_str(), "remove");
  umockdev_testbed_remove_device(bus_.testbed(), sysfs_path_.c_str());
}

int UsbAdapterModel::on_open() {
  if (open_errno != 0) { return fail(open_errno); }
  if (!is_plugged_) { return fail(ENODEV); }
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends) != 0) { return -1; }
  const int least = 1;  // the kernel makes it some kilobytes
  ::setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &least, sizeof(least));
  host_fd_ = ends[0];
  kernel_end_.reset(ends[1]);
  set_ready(false);
  ++opens;
  return host_fd_;
}

void UsbAdapterModel::on_close() {
  // The kernel forgets what was not reaped.
  pending_.clear();
  done_.clear();
  kernel_end_.reset();
  host_fd_ = -1;
}

void UsbAdapterModel::set_ready(bool is_ready) {
  if (host_fd_ < 0 || !kernel_end_.is_open()) { return; }
  std::array<char, 4096> block{};
  if (is_ready) {
    while (::recv(kernel_end_.get(), block.data(), block.size(), MSG_DONTWAIT) > 0) {}
  } else {
    while (::send(host_fd_, block.data(), block.size(), MSG_DONTWAIT | MSG_NOSIGNAL) > 0) {}
  }
}

int UsbAdapterModel::on_ioctl(unsigned long request, void* argument) {
  if (static_cast<std::uint32_t>(request) == USBDEVFS_REAPURBNDELAY) { return reap(argument); }
  if (!is_plugged_) { return fail(ENODEV); }
  switch (static_cast<std::uint32_t>(request)) {
    case USBDEVFS_GET_CAPABILITIES:
      *static_cast<std::uint32_t*>(argument) = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                                               USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
      return 0;
    case USBDEVFS_CLAIMINTERFACE: {
      if (claim_errno != 0) { return fail(claim_errno); }
      if (has_kernel_driver) { return fail(EBUSY); }
      claimed = static_cast<int>(*static_cast<unsigned*>(argument));
      return 0;
    }
    case USBDEVFS_DISCONNECT_CLAIM: {
      if (claim_errno != 0) { return fail(claim_errno); }
      has_kernel_driver = false;
      claimed = static_cast<int>(static_cast<usbdevfs_disconnect_claim*>(argument)->interface);
      return 0;
    }
    case USBDEVFS_RELEASEINTERFACE: claimed = -1; return 0;
    case USBDEVFS_GETDRIVER: {
      if (!has_kernel_driver) { return fail(ENODATA); }
      auto& driver = *static_cast<usbdevfs_getdriver*>(argument);
      std::strncpy(driver.driver, "ftdi_sio", sizeof(driver.driver) - 1);
      return 0;
    }
    case USBDEVFS_IOCTL: {
      const auto& inner = *static_cast<usbdevfs_ioctl*>(argument);
      switch (static_cast<std::uint32_t>(inner.ioctl_code)) {
        case USBDEVFS_DISCONNECT: return take_from_driver();
        case USBDEVFS_CONNECT: return give_to_driver();
        default: return fail(ENOTTY);
      }
    }
    case USBDEVFS_CLEAR_HALT:
      ++halts_cleared_waiting;
      ((*static_cast<unsigned*>(argument) & 0x80U) != 0 ? is_in_halted : is_out_halted) = false;
      return 0;
    case USBDEVFS_SUBMITURB: return submit(*static_cast<usbdevfs_urb*>(argument));
    case USBDEVFS_DISCARDURB: return discard(static_cast<usbdevfs_urb*>(argument));
    default: return fail(ENOTTY);
  }
}

int UsbAdapterModel::take_from_driver() {
  if (!has_kernel_driver) { return fail(ENODATA); }
  has_kernel_driver = false;
  return 0;
}

int UsbAdapterModel::give_to_driver() {
  if (has_kernel_driver || claimed >= 0) { return fail(EBUSY); }
  ++driver_returns;
  has_kernel_driver = true;
  return 1;
}

int UsbAdapterModel::submit(usbdevfs_urb& urb) {
  const bool is_failing = failing_submit == 0;
  failing_submit = std::max(failing_submit - 1, -1);
  if (is_failing) { return fail(submit_errno); }
  if (urb.type != USBDEVFS_URB_TYPE_CONTROL && claimed < 0) { return fail(EINVAL); }
  urb.status = -EINPROGRESS;
  urb.actual_length = 0;
  pending_.push_back(&urb);
  if (urb.type == USBDEVFS_URB_TYPE_CONTROL) {
    control(urb);
    return 0;
  }
  endpoints_used.push_back(urb.endpoint);
  if ((urb.endpoint & 0x80U) == 0) {
    send(urb);
  } else if (is_in_halted) {
    finish(urb, -EPIPE, 0);
  } else if (in_error != 0) {
    finish(urb, -in_error, 0);
  }
  return 0;
}

void UsbAdapterModel::control(usbdevfs_urb& urb) {
  const auto* setup = static_cast<const std::uint8_t*>(urb.buffer);
  const auto word = [setup](int at) { return static_cast<std::uint16_t>(setup[at] | (setup[at + 1] << 8)); };
  // What every device knows: free an endpoint.
  if (setup[0] == 0x02 && setup[1] == 1 && word(2) == 0) {
    if (is_deaf) { return; }
    ++halts_cleared;
    ((word(4) & 0x80U) != 0 ? is_in_halted : is_out_halted) = false;
    finish(urb, 0, 0);
    return;
  }
  const Request request{setup[1], word(2), word(4)};
  requests.push_back(request);
  if (is_deaf) { return; }
  if (setup[0] != 0x40 || request.request == refused_request) {
    finish(urb, -EPIPE, 0);
    return;
  }
  told[request.request] = request.value;
  if (request.request == 0 && request.value == 2) { fifo_.clear(); }
  finish(urb, 0, 0);
}

void UsbAdapterModel::send(usbdevfs_urb& urb) {
  if (is_out_stuck) { return; }
  if (is_out_halted) {
    finish(urb, -EPIPE, 0);
    return;
  }
  const std::span bytes(static_cast<const std::uint8_t*>(urb.buffer), static_cast<std::size_t>(urb.buffer_length));
  laser.receive(clock(), bytes, baud());
  finish(urb, 0, urb.buffer_length);
}

int UsbAdapterModel::baud() const {
  // The words another implementation makes: devices with one line at full speed, and fast ones.
  static const std::map<std::uint16_t, int> kWords{{0x4138, 9600}, {0x809C, 19200}, {0xC04E, 38400}, {0x0006, 500000}};
  static const std::map<std::uint16_t, int> kFastWords{
      {0x04E2, 9600}, {0x0271, 19200}, {0x4138, 38400}, {0x0018, 500000}};
  const auto& words = kind_.packet_size > 64 ? kFastWords : kWords;
  const auto asked = told.find(3);
  if (asked == told.end()) { return 0; }
  const auto found = words.find(static_cast<std::uint16_t>(asked->second));
  return found == words.end() ? 0 : found->second;
}

void UsbAdapterModel::finish(usbdevfs_urb& urb, int status, int length) {
  std::erase(pending_, &urb);
  urb.status = status;
  urb.actual_length = length;
  done_.push_back(&urb);
  set_ready(true);
}

int UsbAdapterModel::discard(usbdevfs_urb* urb) {
  if (std::find(pending_.begin(), pending_.end(), urb) == pending_.end()) { return fail(EINVAL); }
  finish(*urb, -ENOENT, 0);
  return 0;
}

int UsbAdapterModel::reap(void* argument) {
  if (done_.empty()) { return fail(is_plugged_ ? EAGAIN : ENODEV); }
  *static_cast<usbdevfs_urb**>(argument) = done_.front();
  done_.pop_front();
  if (done_.empty()) { set_ready(false); }
  return 0;
}

std::size_t UsbAdapterModel::listening() const {
  return static_cast<std::size_t>(
      std::count_if(pending_.begin(), pending_.end(), [](const auto* urb) { return (urb->endpoint & 0x80U) != 0; }));
}

void UsbAdapterModel::fill(usbdevfs_urb& urb, bool with_data) {
  auto* out = static_cast<std::uint8_t*>(urb.buffer);
  int length = 0;
  while (length < urb.buffer_length) {
    const int room = kind_.packet_size - 2;
    const int count = with_data ? std::min(room, static_cast<int>(fifo_.size())) : 0;
    unsigned status = 0x60U;
    if (count > 0) { status |= std::exchange(line_status, 0U); }
    if (count > 0 && laser.baud != baud()) { status |= 0x08U; }
    out[length++] = 0x31;
    out[length++] = static_cast<std::uint8_t>(status);
    for (int k = 0; k < count; ++k) {
      out[length++] = fifo_.front();
      fifo_.pop_front();
    }
    if (count < room) { break; }
  }
  finish(urb, 0, length);
}

void UsbAdapterModel::live() {
  const Time now = clock();
  constexpr std::size_t kFifo = 256;
  for (const std::uint8_t byte : laser.transmit(now, baud())) {
    const bool is_dropped = bytes_to_overrun > 0;
    bytes_to_overrun = std::max(bytes_to_overrun - 1, 0);
    if (!is_dropped && (fifo_.size() < kFifo || listening() > 0)) {
      fifo_.push_back(byte);
    } else {
      line_status |= 0x02U;
    }
  }
  if (is_in_halted || in_error != 0) {
    for (const auto urbs = pending_; usbdevfs_urb * urb : urbs) {
      if ((urb->endpoint & 0x80U) != 0) { finish(*urb, is_in_halted ? -EPIPE : -in_error, 0); }
    }
    return;
  }
  const auto latency = std::chrono::milliseconds(told.contains(9) ? told.at(9) : 16);
  const auto full = static_cast<std::size_t>(kind_.packet_size - 2);
  while (listening() > 0 && (fifo_.size() >= full || now - t_last_packet_ >= latency)) {
    const auto urb =
        std::find_if(pending_.begin(), pending_.end(), [](const auto* u) { return (u->endpoint & 0x80U) != 0; });
    t_last_packet_ = now;
    fill(**urb, !fifo_.empty());
  }
}

}  // namespace rosid::hal::test
