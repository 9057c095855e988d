// Any bytes into the slcan parser; a frame that comes out must survive being encoded and decoded again.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

#include "hal/can/slcan.hpp"

namespace {

using namespace rosid;

void require(bool condition) {
  if (!condition) { std::abort(); }
}

class Checker final : public hal::SlcanSink {
 public:
  void on_slcan_frame(const hal::CanFrame& frame) override {
    require(frame.length <= 8 && !frame.is_error);
    const hal::SlcanText text = hal::encode_slcan(frame);
    require(text.size > 1);
    const std::string_view line(reinterpret_cast<const char*>(text.bytes.data()), text.size - 1);
    const auto again = hal::decode_slcan(line);
    require(again && again->id == frame.id && again->length == frame.length && again->data == frame.data);
  }
  void on_slcan_line(std::string_view line) override { require(line.size() <= 32); }
  void on_slcan_error() override {}
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  hal::SlcanParser parser;
  Checker checker;
  const std::span<const std::uint8_t> bytes(data, size);
  const std::size_t cut = size == 0 ? 0 : data[0] % size;
  parser.feed(bytes.first(cut), checker);
  parser.feed(bytes.subspan(cut), checker);
  require(parser.bytes() == size);
  return 0;
}
