#pragma once
// Sends LCM messages. A network that cannot be used (no multicast route) is warned about once and tried again for ever.
// Output thread only.

#include <lcm/lcm.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "base/time.hpp"

namespace rosid::daemon {

/// errno of connecting to the address of a udpm:// URL: 0 when packets to it have a way out, or for other providers.
/// LCM would find out as well, but it prints its findings on stderr each time it is asked. Does not block.
int multicast_route_error(const std::string& url);

class LcmOutput {
 public:
  /// Chunks of one view or map leave at least this far apart: more at once overflow a receiver's default buffer.
  static constexpr Duration kChunkSpacing = std::chrono::milliseconds(1);

  explicit LcmOutput(std::string url);

  /// Tries to open the network when it is not open, at most every five seconds. True when this call opened it.
  bool maintain(Time now);
  bool is_open() const { return lcm_ != nullptr; }
  /// Why it is not open.
  const std::string& problem() const { return problem_; }

  template <typename Message>
  void publish(const char* channel, const Message& message) {
    if (!is_open() || !encode(message)) { return; }
    send(channel, buffer_);
  }

  /// Replaces the messages of the channel that have not been sent yet.
  template <typename Message>
  void publish_paced(const char* channel, const std::vector<Message>& messages) {
    std::erase_if(paced_, [&](const Paced& paced) { return paced.channel == channel; });
    if (!is_open()) { return; }
    for (const Message& message : messages) {
      if (encode(message)) { paced_.push_back({channel, buffer_}); }
    }
  }
  /// Sends the next paced message when its time has come.
  void pump(Time now);
  bool has_paced() const { return !paced_.empty(); }

  /// Messages that could not be sent.
  std::uint64_t errors() const { return errors_; }
  std::uint64_t sent() const { return sent_; }
  lcm_t* handle() const { return lcm_.get(); }

 private:
  struct Destroy {
    void operator()(lcm_t* lcm) const { lcm_destroy(lcm); }
  };
  struct Paced {
    std::string channel;
    std::vector<std::uint8_t> bytes;
  };

  template <typename Message>
  bool encode(const Message& message) {
    const int size = message.getEncodedSize();
    buffer_.resize(static_cast<std::size_t>(size));  // grows to the largest message, then no longer allocates
    const bool is_encoded = message.encode(buffer_.data(), 0, size) == size;
    errors_ += is_encoded ? 0 : 1;
    return is_encoded;
  }
  void send(const char* channel, const std::vector<std::uint8_t>& bytes);

  std::string url_;
  std::unique_ptr<lcm_t, Destroy> lcm_;
  std::string problem_;
  bool was_tried_ = false;
  Time t_tried_;
  Time t_paced_;
  std::deque<Paced> paced_;
  std::vector<std::uint8_t> buffer_;
  std::uint64_t errors_ = 0;
  std::uint64_t sent_ = 0;
};

}  // namespace rosid::daemon
