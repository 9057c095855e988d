#pragma once
// A USB bus for tests: the real libusb sees devices in a /sys of umockdev and opens their nodes, but what it says to
// the kernel (ioctl) ends in FTDI adapters that are played here, with the scripted laser behind them.

#include <linux/usbdevice_fs.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "hal/io/device_links.hpp"
#include "hal/io/unique_fd.hpp"
#include "tests/unit/hal/fake_lms.hpp"

// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming): umockdev's
struct _UMockdevTestbed;

namespace rosid::hal::test {

class UsbAdapterModel;

/// Owns /sys and /dev/bus/usb while it lives; one at a time.
class UsbBus {
 public:
  UsbBus();
  ~UsbBus();
  UsbBus(const UsbBus&) = delete;
  UsbBus& operator=(const UsbBus&) = delete;

  _UMockdevTestbed* testbed() const { return testbed_; }
  void add(UsbAdapterModel& adapter);
  void remove(UsbAdapterModel& adapter);
  // Also from libusb's thread that listens to udev.
  UsbAdapterModel* with_node(const std::string& path) const;
  UsbAdapterModel* with_descriptor(int fd) const;
  static std::atomic<UsbBus*>& current();
  int next_address() { return ++addresses_; }

 private:
  _UMockdevTestbed* testbed_;
  mutable std::mutex mutex_;
  std::vector<UsbAdapterModel*> adapters_;
  int addresses_ = 1;
};

/// An FTDI chip on the bus. Everything happens in calls of the test's thread.
class UsbAdapterModel {
 public:
  struct Kind {
    std::string port = "1-2";
    int vendor = 0x0403;
    int product = 0x6001;
    int bcd_device = 0x0600;
    std::string serial = "A6008isP";
    int packet_size = 64;
    int channels = 1;
  };
  struct Request {
    std::uint8_t request;
    std::uint16_t value;
    std::uint16_t index;
    friend bool operator==(const Request&, const Request&) = default;
  };

  explicit UsbAdapterModel(UsbBus& bus) : UsbAdapterModel(bus, Kind{}) {}
  UsbAdapterModel(UsbBus& bus, Kind kind);
  ~UsbAdapterModel();
  UsbAdapterModel(const UsbAdapterModel&) = delete;
  UsbAdapterModel& operator=(const UsbAdapterModel&) = delete;

  /// A new number on the bus each time, as the kernel gives.
  void plug();
  void unplug();
  /// What the laser and the chip do until now.
  void live();
  /// Of the line, from what the chip was told; 0 when that is no rate of the table.
  int baud() const;
  bool is_opened() const { return host_fd_ >= 0; }
  std::size_t transfers_under_way() const { return pending_.size() + done_.size(); }
  std::size_t listening() const;
  std::string node() const;

  ClockFunction clock = monotonic_now;
  FakeLms laser;
  std::vector<Request> requests;
  std::map<std::uint8_t, unsigned> told;  ///< last value of each request
  bool has_kernel_driver = true;
  int claimed = -1;
  int opens = 0;
  int halts_cleared = 0;          ///< by requests like any other
  int halts_cleared_waiting = 0;  ///< by the call of the kernel that waits for the chip
  int driver_returns = 0;         ///< times the kernel was asked for its driver, which asks the chip and waits for it
  std::vector<std::uint8_t> endpoints_used;

  // Faults.
  int open_errno = 0;
  int claim_errno = 0;
  int refused_request = -1;   ///< is answered by a stall
  bool is_deaf = false;       ///< requests are not answered
  bool is_out_stuck = false;  ///< bytes to the line are never taken
  int failing_submit = -1;    ///< counts down; the submission at 0 fails
  int submit_errno = EIO;
  int bytes_to_overrun = 0;  ///< the chip loses so many of the next
  unsigned line_status = 0;  ///< error bits of the next packet with data
  int in_error = 0;          ///< errno all transfers from the device end with
  bool is_in_halted = false;
  bool is_out_halted = false;

  // For the hooks in front of the C library.
  bool has(int fd) const { return fd == host_fd_; }
  int on_open();
  void on_close();
  int on_ioctl(unsigned long request, void* argument);

 private:
  int give_to_driver();
  int take_from_driver();
  int submit(usbdevfs_urb& urb);
  void control(usbdevfs_urb& urb);
  void send(usbdevfs_urb& urb);
  void finish(usbdevfs_urb& urb, int status, int length);
  void fill(usbdevfs_urb& urb, bool with_data);
  int discard(usbdevfs_urb* urb);
  int reap(void* argument);
  void set_ready(bool is_ready);

  UsbBus& bus_;
  Kind kind_;
  std::atomic<int> address_ = 1;
  bool is_plugged_ = false;
  std::string sysfs_path_;
  std::atomic<int> host_fd_ = -1;
  UniqueFd kernel_end_;
  std::deque<usbdevfs_urb*> pending_;
  std::deque<usbdevfs_urb*> done_;
  std::deque<std::uint8_t> fifo_;
  Time t_last_packet_;
};

}  // namespace rosid::hal::test
