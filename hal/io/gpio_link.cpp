#include "hal/io/gpio_link.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <utility>

#include "hal/io/errno_text.hpp"

namespace rosid::hal {

namespace {
// How often quiet lines are asked whether their chip is still there.
constexpr Duration kCheckPeriod = std::chrono::seconds(1);
}  // namespace

GpioLink::GpioLink(const HalConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock)
    : is_enabled_(is_on_gpio(config.turret)), config_(config.gpio), loop_(loop), tap_(tap), clock_(clock) {}

GpioLink::~GpioLink() {
  listen(false);
}

void GpioLink::step() {
  if (!is_enabled_ || front_end_ == nullptr) { return; }
  const Time now = clock_();
  if (!source_ && reopen_.is_due(now)) { try_open(now); }
  if (!source_) { return; }
  if (now - t_check_ >= kCheckPeriod) {
    t_check_ = now;
    const int error = source_->check();
    if (error != 0) {
      close(now, fmt::format("the GPIO chip of the turret was lost: {}; gpiodetect lists those there are",
                             errno_text(error)));
      return;
    }
  }
  if (now - t_read_ >= kReadPeriod) { listen(true); }
}

void GpioLink::try_open(Time now) {
  auto opened = open_gpio_lines(config_);
  if (!opened) {
    ++counters_.open_failures;
    last_error_ = opened.error().message;
    reopen_.on_failure(now);
    return;
  }
  source_ = std::move(*opened);
  t_read_ = Time{};
  t_check_ = now;
  ++counters_.opened;
  last_error_.clear();
  tap_.on_turret_link(now, true);
  front_end_->on_turret_link(now, true);
}

void GpioLink::close(Time now, std::string why) {
  listen(false);
  source_.reset();
  last_error_ = std::move(why);
  reopen_.on_failure(now);
  tap_.on_turret_link(now, false);
  front_end_->on_turret_link(now, false);
}

void GpioLink::listen(bool is_wanted) {
  if (is_wanted == is_listening_ || !source_) { return; }
  if (!is_wanted) {
    loop_.unwatch(source_->fd());
    is_listening_ = false;
    return;
  }
  if (auto watched = loop_.watch(source_->fd(), EPOLLIN, *this); !watched) {
    close(clock_(), watched.error().message);
    return;
  }
  is_listening_ = true;
}

void GpioLink::on_event(std::uint32_t events) {
  read_edges();
  if (source_ && (events & (EPOLLHUP | EPOLLERR)) != 0U) {
    close(clock_(), "the GPIO chip of the turret was unplugged; gpiodetect lists those there are");
  }
}

void GpioLink::read_edges() {
  std::size_t total = 0;
  while (source_) {
    if (total >= kMostEdges) {
      ++counters_.limited;
      break;
    }
    const EdgeSource::Received got = source_->read(buffer_);
    const Time now = clock_();
    if (got.status == IoStatus::WouldBlock) { break; }
    if (got.status != IoStatus::Done) {
      close(now, got.error == 0
                     ? "the GPIO chip of the turret was unplugged; gpiodetect lists those there are"
                     : fmt::format("the GPIO chip of the turret was lost: {}; gpiodetect lists those there are",
                                   errno_text(got.error)));
      return;
    }
    reopen_.on_success();
    total += got.count;
    ++counters_.reads;
    counters_.edges += got.count;
    t_check_ = now;
    t_read_ = now;
    const auto edges = std::span<const EdgeRecord>(buffer_).first(std::min(got.count, buffer_.size()));
    tap_.on_turret_edges(now, edges);
    front_end_->on_turret_edges(now, edges);
  }
  // One wake-up for many edges: the rest is collected by the kernel until the period is over.
  listen(false);
}

}  // namespace rosid::hal
