#pragma once
// One channel of an FTDI chip by libusb: everything as asynchronous transfers, nothing waits for the device.

#include <libusb-1.0/libusb.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hal/io/byte_line.hpp"
#include "hal/io/usb_adapters.hpp"
#include "hal/usb/ftdi_chip.hpp"
#include "hal/usb/ftdi_packets.hpp"

namespace rosid::hal {

template <auto Release>
struct UsbReleaser {
  template <typename T>
  void operator()(T* object) const {
    Release(object);
  }
};
using UsbHandle = std::unique_ptr<libusb_device_handle, UsbReleaser<libusb_close>>;

class UsbLine;

/// What is known of the line beyond its life: where it is, and what the one before it left behind.
struct UsbLineSlot {
  UsbLine* line = nullptr;  ///< nullptr while there is none
  // A line was lost for this endpoint: the next one frees it.
  bool is_in_halted = false;
  bool is_out_halted = false;
};

/// Takes the interface from the kernel's driver. The set-up is sent step by step; the line is open when the chip has
/// taken the last of it. I/O thread.
///
/// The kernel's driver gets the interface back when the line is closed while all is well, and only then: the kernel
/// has the driver ask the chip for its state before it returns, each question with seconds of patience, and who waits
/// for a mute chip so long is no I/O thread any more.
class UsbLine final : public ByteLine {
 public:
  /// slot: outlives the line. Errors name the adapter and what to do: NotFound (gone), PermissionDenied, Busy,
  /// Unsupported (the chip, its channel, the rate), Io.
  static Result<std::unique_ptr<UsbLine>> open(const UsbAdapter& adapter, const LaserConfig& config,
                                               libusb_context* context, ByteLineOwner& owner, ClockFunction clock,
                                               UsbLineSlot& slot);
  /// Cancels what is under way and waits for that: the kernel does it at once, after 0.5 s it is not waited for any
  /// longer. Gives the interface back to the kernel's driver when the chip has answered within the last second and
  /// the line has not failed; that costs what the driver's questions cost, some milliseconds with a chip that answers.
  ~UsbLine() override;
  UsbLine(const UsbLine&) = delete;
  UsbLine& operator=(const UsbLine&) = delete;

  const std::string& name() const override { return name_; }
  bool is_open() const override { return is_told_; }
  IoResult write(std::span<const std::uint8_t> bytes) override;
  bool is_drained(Time now) const override;
  Result<void> set_baud(int baud) override;
  int baud() const override { return baud_; }
  Counters counters() const override;

  /// To be called after each round of libusb's events, outside of them. The owner may destroy the line in it.
  void after_events();
  /// Tells the owner when it has failed outside of events; also this may destroy the line.
  void report_failure();
  /// The line cannot be watched any more.
  void fail(std::string why);

 private:
  // A chip with little to say completes one transfer each millisecond: these cover a thread that is kept from running
  // for as many milliseconds, the chip's own buffer of 256 bytes or more adds 5 ms at 500 kbaud.
  static constexpr std::size_t kInTransfers = 32;
  static constexpr std::size_t kOutTransfers = 4;
  static constexpr std::size_t kInSize = 512;
  static constexpr std::size_t kOutSize = 64;

  struct Step {
    FtdiRequest request;
    bool is_freeing = false;  // an endpoint: a request every USB device knows
  };
  enum class Phase : std::uint8_t { SettingUp, Running, Failed, Closing };

  using TransferHandle = std::unique_ptr<libusb_transfer, UsbReleaser<libusb_free_transfer>>;
  struct Transfer {
    UsbLine* line = nullptr;
    TransferHandle handle;
    bool is_in_flight = false;
    std::array<std::uint8_t, kInSize> bytes{};
  };
  struct Endpoints {
    unsigned char in = 0;
    unsigned char out = 0;
    int packet_size = 0;
  };

  UsbLine(UsbHandle handle, const UsbAdapter& adapter, const LaserConfig& config, FtdiChip chip,
          const Endpoints& endpoints, libusb_context* context, ByteLineOwner& owner, ClockFunction clock,
          UsbLineSlot& slot);
  static Endpoints find_endpoints(libusb_device* device, int interface);
  Result<void> start();
  Result<void> take_interface();
  void plan_set_up(const FtdiRequest& baud);
  bool may_give_back() const;

  static void LIBUSB_CALL on_received(libusb_transfer* raw);
  static void LIBUSB_CALL on_sent(libusb_transfer* raw);
  static void LIBUSB_CALL on_told(libusb_transfer* raw);
  void receive(Transfer& transfer);
  void sent(Transfer& transfer);
  void told();
  void listen(Transfer& transfer);
  bool submit(Transfer& transfer);
  bool tell(const Step& step);
  void set_up_next();
  void fail_halted(bool is_in);
  /// True when it may be tried again.
  bool count_failure(libusb_transfer_status status);
  bool is_under_way() const;
  void cancel_all();

  UsbHandle handle_;
  std::string name_;
  FtdiChip chip_;
  int interface_;
  Endpoints endpoints_;
  libusb_context* context_;
  ByteLineOwner& owner_;
  ClockFunction clock_;
  UsbLineSlot& slot_;
  FtdiPackets packets_;
  Counters counters_;
  Phase phase_ = Phase::SettingUp;
  std::string why_failed_;
  bool is_told_ = false;          // the owner knows that it is open
  std::optional<Time> t_answer_;  // the chip's last sign of life
  int failures_in_a_row_ = 0;
  int baud_;
  std::vector<Step> set_up_;
  std::size_t set_up_at_ = 0;
  Time t_line_free_;
  Transfer control_;
  std::vector<Transfer> in_;
  std::vector<Transfer> out_;
};

}  // namespace rosid::hal
