#include "msgs/log.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <deque>
#include <limits>
#include <system_error>
#include <utility>

#include "msgs/bytes.hpp"
#include "msgs/log_codec.hpp"
#include "msgs/stamp_check.hpp"

namespace rosid::msgs {

namespace {

// LCM event log: sync word, event number, time stamp in us, length of the channel's name, length of the data; all big
// endian; then the name and the data.
constexpr std::uint32_t kSync = 0xEDA1DA01U;
constexpr std::size_t kHeaderSize = 28;
constexpr std::size_t kMaxChannel = 63;                 // LCM's own limit
constexpr std::size_t kMaxData = std::size_t{4} << 20;  // far above any event; a larger length is damage
constexpr std::size_t kReadSize = std::size_t{64} << 10;

struct CloseFile {
  void operator()(std::FILE* file) const { static_cast<void>(std::fclose(file)); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

std::string errno_text(int code) {
  return std::generic_category().message(code);
}

ErrorCode code_from_errno(int code) {
  switch (code) {
    case ENOENT: return ErrorCode::NotFound;
    case EACCES:
    case EPERM: return ErrorCode::PermissionDenied;
    default: return ErrorCode::Io;
  }
}

}  // namespace

struct LogWriter::Impl {
  File file;
  std::string path;
  std::int64_t event_number = 0;
  std::vector<std::uint8_t> buffer;
};

LogWriter::LogWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LogWriter::LogWriter(LogWriter&&) noexcept = default;
LogWriter& LogWriter::operator=(LogWriter&&) noexcept = default;
LogWriter::~LogWriter() = default;

Result<LogWriter> LogWriter::create(const std::filesystem::path& path) {
  auto impl = std::make_unique<Impl>();
  impl->path = path.string();
  impl->file.reset(std::fopen(impl->path.c_str(), "wbe"));
  if (!impl->file) {
    const int code = errno;
    return make_error(code_from_errno(code), fmt::format("{}: cannot create: {}", impl->path, errno_text(code)));
  }
  return LogWriter(std::move(impl));
}

Result<void> LogWriter::write(const LogRecord& record, std::int64_t epoch_offset_us) {
  const std::string_view channel = channel_of(record);
  std::vector<std::uint8_t>& buffer = impl_->buffer;
  buffer.clear();
  LcmWriter out(buffer);
  out.put(kSync);
  out.put(impl_->event_number);
  out.put((to_ns(record.t) / 1000) + epoch_offset_us);
  out.put(static_cast<std::int32_t>(channel.size()));
  const std::size_t length_position = buffer.size();
  out.put(std::int32_t{0});
  for (const char c : channel) { out.put(static_cast<std::uint8_t>(c)); }
  const std::size_t data_position = buffer.size();
  encode_payload(record, buffer);
  std::vector<std::uint8_t> length;
  LcmWriter(length).put(static_cast<std::int32_t>(buffer.size() - data_position));
  std::copy(length.begin(), length.end(), buffer.begin() + static_cast<std::ptrdiff_t>(length_position));
  if (std::fwrite(buffer.data(), 1, buffer.size(), impl_->file.get()) != buffer.size()) {
    const int code = errno;
    return make_error(ErrorCode::Io, fmt::format("{}: cannot write: {}", impl_->path, errno_text(code)));
  }
  ++impl_->event_number;
  return {};
}

Result<void> LogWriter::flush() {
  if (std::fflush(impl_->file.get()) != 0) {
    const int code = errno;
    return make_error(ErrorCode::Io, fmt::format("{}: cannot write: {}", impl_->path, errno_text(code)));
  }
  return {};
}

struct LogReader::Impl {
  File file;
  std::vector<std::uint8_t> buffer;  // bytes [begin, buffer.size()) are not consumed yet
  std::size_t begin = 0;
  std::uint64_t skipped = 0;
  bool at_end = false;  // of the file; the buffer may still hold bytes
  StampCheck stamps;

  struct Event {
    std::int64_t stamp_us;
    LogRecord record;
  };
  std::deque<Event> ahead;  // read, not given out yet
  bool has_begun = false;

  enum class Damage : std::uint8_t { None, CutOff, Garbled };
  Damage damage = Damage::None;  // the last bytes read were no event; not counted yet

  /// At least `count` unconsumed bytes, or as many as the file has left.
  std::span<const std::uint8_t> peek(std::size_t count);
  /// Moves to the next sync word behind the current position.
  void resynchronise();
  void note_damage(Damage kind);
  void note_event();
  void note_end();
  /// The next event of a known channel, whatever its time.
  std::optional<Event> read_event();
  void check_first_time();
};

std::span<const std::uint8_t> LogReader::Impl::peek(std::size_t count) {
  if (buffer.size() - begin < count) {
    buffer.erase(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(begin));
    begin = 0;
  }
  while (buffer.size() < begin + count && !at_end) {
    const std::size_t have = buffer.size();
    buffer.resize(have + kReadSize);
    const std::size_t got = std::fread(buffer.data() + have, 1, kReadSize, file.get());
    buffer.resize(have + got);
    at_end = got < kReadSize;
  }
  return std::span<const std::uint8_t>(buffer).subspan(begin);
}

void LogReader::Impl::note_damage(Damage kind) {
  damage = std::max(damage, kind);
}

void LogReader::Impl::note_event() {
  if (damage != Damage::None) { ++skipped; }
  damage = Damage::None;
}

void LogReader::Impl::note_end() {
  if (damage == Damage::Garbled) { ++skipped; }
  damage = Damage::None;
}

void LogReader::Impl::resynchronise() {
  constexpr std::array<std::uint8_t, 4> kPattern{0xED, 0xA1, 0xDA, 0x01};
  begin = std::min(begin + 1, buffer.size());
  for (auto window = peek(kPattern.size()); window.size() >= kPattern.size(); window = peek(kPattern.size())) {
    const auto hit = std::search(window.begin(), window.end(), kPattern.begin(), kPattern.end());
    if (hit != window.end()) {
      begin += static_cast<std::size_t>(hit - window.begin());
      return;
    }
    begin += window.size() - (kPattern.size() - 1);
  }
  begin = buffer.size();
}

LogReader::LogReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LogReader::LogReader(LogReader&&) noexcept = default;
LogReader& LogReader::operator=(LogReader&&) noexcept = default;
LogReader::~LogReader() = default;

Result<LogReader> LogReader::open(const std::filesystem::path& path) {
  auto impl = std::make_unique<Impl>();
  impl->file.reset(std::fopen(path.c_str(), "rbe"));
  // A directory can be opened for reading, but not read.
  std::error_code ignored;
  if (impl->file && std::filesystem::is_directory(path, ignored)) {
    return make_error(ErrorCode::InvalidArgument, fmt::format("{}: is a directory, not a log", path.string()));
  }
  if (!impl->file) {
    const int code = errno;
    return make_error(code_from_errno(code), fmt::format("{}: cannot open: {}", path.string(), errno_text(code)));
  }
  return LogReader(std::move(impl));
}

std::optional<LogReader::Impl::Event> LogReader::Impl::read_event() {
  for (;;) {
    const auto head = peek(kHeaderSize);
    if (head.size() < kHeaderSize) {
      note_end();
      return std::nullopt;
    }
    LcmReader header(head.first(kHeaderSize));
    const bool has_sync = header.get<std::uint32_t>() == kSync;
    static_cast<void>(header.get<std::int64_t>());
    const auto stamp_us = header.get<std::int64_t>();
    const auto channel_size = header.get<std::uint32_t>();
    const auto data_size = header.get<std::uint32_t>();
    if (!has_sync || channel_size == 0 || channel_size > kMaxChannel || data_size > kMaxData) {
      note_damage(Damage::Garbled);
      resynchronise();
      continue;
    }
    const std::size_t event_size = kHeaderSize + channel_size + data_size;
    const auto window = peek(event_size + sizeof(kSync));
    if (window.size() < event_size) {
      // The last event was cut off, which is how the log of a crash ends, or its length is damaged: in that case whole
      // events follow.
      note_damage(Damage::CutOff);
      resynchronise();
      continue;
    }
    const auto name = window.subspan(kHeaderSize, channel_size);
    const std::string channel(name.begin(), name.end());
    auto record = decode_payload(channel, window.subspan(kHeaderSize + channel_size, data_size));
    LcmReader following(window.subspan(event_size));
    const bool is_framed = window.size() == event_size || following.get<std::uint32_t>() == kSync;
    if (record.has_value() || (is_framed && !is_log_channel(channel))) {
      note_event();
      begin += event_size;
      if (!record.has_value()) { continue; }  // somebody else's channel
      return Event{stamp_us, std::move(*record)};
    }
    note_damage(Damage::Garbled);
    if (is_framed) {
      begin += event_size;
    } else {
      resynchronise();
    }
  }
}

/// The first record's time is where everything starts, and no record before it tells whether it is right: the two
/// behind it do. When they agree with each other but not with it, it is given the time of its stamp, or keeps its own,
/// whichever lies nearer to theirs.
void LogReader::Impl::check_first_time() {
  for (int k = 0; k < 3; ++k) {
    auto event = read_event();
    if (!event) { return; }
    ahead.push_back(std::move(*event));
  }
  const auto offset_us =
      StampCheck::common_offset(ahead[1].stamp_us, ahead[1].record.t, ahead[2].stamp_us, ahead[2].record.t);
  if (!offset_us) { return; }
  stamps.expect(*offset_us);
  Event& first = ahead[0];
  if (stamps.is_expected(first.stamp_us, first.record.t)) { return; }
  ++skipped;
  const Time t_next = ahead[1].record.t;
  constexpr Duration kNear = std::chrono::minutes(1);
  const bool is_stamp_wrong = first.record.t <= t_next && first.record.t > t_next - kNear;
  const auto from_stamp_us = static_cast<std::int64_t>(static_cast<std::uint64_t>(first.stamp_us) - *offset_us);
  constexpr std::int64_t kMost_us = std::numeric_limits<std::int64_t>::max() / 1000;
  if (!is_stamp_wrong && from_stamp_us < kMost_us && from_stamp_us > -kMost_us) {
    first.record.t = time_from_ns(from_stamp_us * 1000);
  }
  first.stamp_us = static_cast<std::int64_t>(*offset_us + static_cast<std::uint64_t>(to_ns(first.record.t) / 1000));
}

std::optional<LogRecord> LogReader::next() {
  Impl& in = *impl_;
  if (!std::exchange(in.has_begun, true)) { in.check_first_time(); }
  for (;;) {
    std::optional<Impl::Event> event;
    if (in.ahead.empty()) {
      event = in.read_event();
    } else {
      event = std::move(in.ahead.front());
      in.ahead.pop_front();
    }
    if (!event) { return std::nullopt; }
    if (in.stamps.is_good(event->stamp_us, event->record.t)) { return std::move(event->record); }
    ++in.skipped;
  }
}

std::uint64_t LogReader::skipped() const {
  return impl_->skipped;
}

}  // namespace rosid::msgs
