// The laser's line as a serial port of the kernel.

#include <fmt/format.h>
#include <sys/epoll.h>

#include <array>
#include <utility>

#include "hal/io/byte_line.hpp"
#include "hal/io/errno_text.hpp"
#include "hal/io/serial_port.hpp"

namespace rosid::hal {

namespace {

constexpr int kMostReads = 8;
constexpr std::size_t kReadSize = 4096;
// A driver gives the bytes of a telegram in a dozen pieces. The first one wakes, for its stamp; the others may wait.
constexpr Duration kPiecesPause = std::chrono::milliseconds(4);

class TtyLine final : public ByteLine, private EventHandler {
 public:
  TtyLine(SerialPort port, std::string path, EventLoop& loop, ByteLineOwner& owner, ClockFunction clock)
      : port_(std::move(port)), path_(std::move(path)), loop_(loop), owner_(owner), clock_(clock) {}
  ~TtyLine() override { loop_.unwatch(port_.fd()); }
  TtyLine(const TtyLine&) = delete;
  TtyLine& operator=(const TtyLine&) = delete;

  Result<void> watch() { return loop_.watch(port_.fd(), EPOLLIN, *this); }

  const std::string& name() const override { return path_; }
  bool is_open() const override { return true; }
  IoResult write(std::span<const std::uint8_t> bytes) override { return port_.write(bytes); }
  bool is_drained(Time /*now*/) const override { return port_.unsent() == 0; }
  Result<void> set_baud(int baud) override { return port_.set_baud(baud); }
  int baud() const override { return port_.baud(); }

 private:
  void on_event(std::uint32_t events) override;

  SerialPort port_;
  std::string path_;
  EventLoop& loop_;
  ByteLineOwner& owner_;
  ClockFunction clock_;
  std::array<std::uint8_t, kReadSize> buffer_{};
};

void TtyLine::on_event(std::uint32_t events) {
  bool has_bytes = false;
  for (int k = 0; k < kMostReads; ++k) {
    const IoResult got = port_.read(buffer_);
    if (got.status == IoStatus::WouldBlock) { break; }
    if (got.status != IoStatus::Done) {
      owner_.on_line_lost(clock_(), got.error == 0 ? fmt::format("{} was unplugged or closed", path_)
                                                   : fmt::format("{} was lost: {}", path_, errno_text(got.error)));
      return;
    }
    has_bytes = true;
    owner_.on_line_bytes(clock_(), std::span<const std::uint8_t>(buffer_).first(got.size));
    if (got.size < buffer_.size()) { break; }  // that was all
  }
  if ((events & (EPOLLHUP | EPOLLERR)) != 0U) {
    owner_.on_line_lost(clock_(), fmt::format("{} was unplugged or closed", path_));
    return;
  }
  if (has_bytes) {
    loop_.rest(port_.fd(), *this, kPiecesPause);
  } else {
    loop_.resume(port_.fd());
  }
  owner_.on_line_event(clock_());
}

class TtyOpener final : public ByteLineOpener {
 public:
  TtyOpener(const LaserConfig& config, EventLoop& loop, ByteLineOwner& owner, ClockFunction clock)
      : device_(config.device), baud_(config.baud), loop_(loop), owner_(owner), clock_(clock) {}

  Result<std::unique_ptr<ByteLine>> open() override {
    auto port = SerialPort::open(device_, baud_);
    if (!port) { return tl::make_unexpected(port.error()); }
    auto line = std::make_unique<TtyLine>(std::move(*port), device_, loop_, owner_, clock_);
    if (auto watched = line->watch(); !watched) { return tl::make_unexpected(watched.error()); }
    return line;
  }

 private:
  std::string device_;
  int baud_;
  EventLoop& loop_;
  ByteLineOwner& owner_;
  ClockFunction clock_;
};

}  // namespace

std::unique_ptr<ByteLineOpener> make_tty_opener(const LaserConfig& config, EventLoop& loop, ByteLineOwner& owner,
                                                ClockFunction clock) {
  return std::make_unique<TtyOpener>(config, loop, owner, clock);
}

}  // namespace rosid::hal
