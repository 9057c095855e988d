// In the place of the line, its set-up and its opener where there is no libusb.

#include "hal/io/byte_line.hpp"
#include "hal/io/support.hpp"

namespace rosid::hal {

namespace {

class NoOpener final : public ByteLineOpener {
 public:
  Result<std::unique_ptr<ByteLine>> open() override {
    return make_error(ErrorCode::Unsupported, "USB: rosid was built without libusb");
  }
};

}  // namespace

std::unique_ptr<ByteLineOpener> make_usb_opener(const HalConfig& /*config*/, EventLoop& /*loop*/,
                                                ByteLineOwner& /*owner*/, ClockFunction /*clock*/) {
  return std::make_unique<NoOpener>();
}

bool has_usb_support() {
  return false;
}

}  // namespace rosid::hal
