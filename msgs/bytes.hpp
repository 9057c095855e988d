#pragma once
// Bounds-checked reading and growing writing of binary formats, for big-endian (LCM) and little-endian (map file) data.

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace rosid::msgs {

namespace detail {

template <std::size_t Size>
struct UnsignedOf;
template <>
struct UnsignedOf<1> {
  using Type = std::uint8_t;
};
template <>
struct UnsignedOf<2> {
  using Type = std::uint16_t;
};
template <>
struct UnsignedOf<4> {
  using Type = std::uint32_t;
};
template <>
struct UnsignedOf<8> {
  using Type = std::uint64_t;
};

template <typename T>
concept Scalar = std::is_arithmetic_v<T>;

}  // namespace detail

/// Appends scalars to a byte vector in the given byte order.
template <std::endian Order>
class ByteWriter {
 public:
  explicit ByteWriter(std::vector<std::uint8_t>& out) : out_(out) {}

  template <detail::Scalar T>
  void put(T value) {
    using U = typename detail::UnsignedOf<sizeof(T)>::Type;
    const U bits = std::bit_cast<U>(value);
    std::array<std::uint8_t, sizeof(T)> bytes{};
    for (std::size_t k = 0; k < sizeof(T); ++k) {
      const std::size_t shift = Order == std::endian::little ? k : sizeof(T) - 1 - k;
      bytes[k] = static_cast<std::uint8_t>(bits >> (8U * shift));
    }
    out_.insert(out_.end(), bytes.begin(), bytes.end());
  }
  template <detail::Scalar T>
  void put_all(std::span<const T> values) {
    for (const T value : values) { put(value); }
  }
  void put_bytes(std::span<const std::uint8_t> bytes) { out_.insert(out_.end(), bytes.begin(), bytes.end()); }
  std::size_t size() const { return out_.size(); }

 private:
  std::vector<std::uint8_t>& out_;
};

/// Reads scalars from bytes. After the first read beyond the end every read yields zero and failed() is true, so a
/// decoder checks once, at its end. Counts must be checked against remaining() before memory is reserved for them.
template <std::endian Order>
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <detail::Scalar T>
  T get() {
    using U = typename detail::UnsignedOf<sizeof(T)>::Type;
    if (!claim(sizeof(T))) { return T{}; }
    U bits = 0;
    for (std::size_t k = 0; k < sizeof(T); ++k) {
      const std::size_t shift = Order == std::endian::little ? k : sizeof(T) - 1 - k;
      bits = static_cast<U>(bits | (static_cast<U>(bytes_[position_ - sizeof(T) + k]) << (8U * shift)));
    }
    return std::bit_cast<T>(bits);
  }
  template <detail::Scalar T>
  void get_all(std::span<T> values) {
    for (T& value : values) { value = get<T>(); }
  }
  std::span<const std::uint8_t> get_bytes(std::size_t count) {
    return claim(count) ? bytes_.subspan(position_ - count, count) : std::span<const std::uint8_t>{};
  }

  std::size_t position() const { return position_; }
  std::size_t remaining() const { return bytes_.size() - position_; }
  bool failed() const { return failed_; }
  /// Nothing was missing and nothing is left over.
  bool is_complete() const { return !failed_ && remaining() == 0; }

 private:
  bool claim(std::size_t count) {
    if (failed_ || count > remaining()) {
      failed_ = true;
      return false;
    }
    position_ += count;
    return true;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t position_ = 0;
  bool failed_ = false;
};

using LcmWriter = ByteWriter<std::endian::big>;
using LcmReader = ByteReader<std::endian::big>;
using MapWriter = ByteWriter<std::endian::little>;
using MapReader = ByteReader<std::endian::little>;

}  // namespace rosid::msgs
