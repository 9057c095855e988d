#pragma once
// Complete telegrams of the LMS2xx protocol as printed in manuals and drivers, or computed by two independent
// implementations of the checksum.

#include <array>

namespace rosid::hal::test {

inline constexpr std::array kRequestVectors{
    "02 00 02 00 20 42 52 08",
    "02 00 02 00 20 41 51 08",
    "02 00 02 00 20 40 50 08",
    "02 00 02 00 20 48 58 08",
    "02 00 02 00 20 24 34 08",
    "02 00 02 00 20 25 35 08",
    "02 00 02 00 20 2A 3A 08",
    "02 00 06 00 20 27 01 00 B5 00 12 09",
    "02 00 08 00 20 2B 01 00 01 00 B5 00 AF 5A",
    "02 00 0A 00 20 00 53 49 43 4B 5F 4C 4D 53 BE C5",
    "02 00 01 00 31 15 12",
    "02 00 01 00 3A 1E 12",
    "02 00 01 00 32 16 12",
    "02 00 01 00 35 11 12",
    "02 00 01 00 74 50 12",
    "02 00 01 00 10 34 12",
    "02 00 02 00 30 01 31 18",
    "02 00 05 00 3B B4 00 64 00 97 49",
    "02 00 05 00 3B B4 00 32 00 3B 1F",
    "02 00 05 00 3B 64 00 64 00 1D 0F",
    "02 00 05 00 3B 64 00 32 00 B1 59",
    "02 00 05 00 3B 64 00 19 00 E7 72",
    "02 00 21 00 77 00 00 00 00 00 0D 00 00 00 02 02 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 "
    "20 CB",
    "02 00 23 00 77 00 00 46 00 03 00 01 00 00 02 02 02 00 00 0A 0A 50 64 00 0A 0A 50 64 00 0A 0A 50 64 00 00 00 00 02 "
    "00 CF 21",
};

inline constexpr std::array kReplyVectors{
    "02 80 03 00 A0 00 10 16 0A",
    "02 81 03 00 A0 00 10 36 1A",
    "02 80 03 00 A0 00 30 36 0A",
    "02 80 03 00 A0 00 18 1E 0A",
    "02 80 03 00 A0 01 10 14 0B",
    "02 80 03 00 A0 02 10 12 08",
    "02 81 07 00 BB 01 64 00 64 00 10 4A 3F",
    "02 80 07 00 BB 01 B4 00 32 00 10 03 9D",
    "02 80 07 00 BB 00 B4 00 32 00 10 23 8D",
    "02 81 17 00 90 4C 4D 53 32 30 30 3B 33 30 31 30 36 33 3B 56 30 32 2E 30 36 20 13 64 5A",
    "02 80 02 00 92 10 7F 33",
    "02 80 02 00 91 10 79 30",
    "02 80 17 00 BA 4C 4D 53 32 30 30 3B 33 30 31 30 36 31 3B 56 30 32 2E 33 30 20 10 3D ED",
    "02 80 24 00 F4 00 00 46 00 00 00 01 00 00 02 02 02 00 00 0A 0A 50 64 00 0A 0A 50 64 00 0A 0A 50 64 00 00 00 00 02 "
    "00 10 0A 2F",
    "02 80 02 00 B2 10 3F 13",
    "02 80 04 00 B2 03 1D 10 5A 37",
    "02 80 0A 00 B0 03 40 E8 03 FF 1F C4 29 10 A3 6B",
    "02 80 0C 00 B0 03 40 E8 03 D0 07 B8 0B 07 09 10 96 6E",
    "02 80 0A 00 B0 03 30 64 00 C8 00 2C 01 10 96 7C",
};

/// A full scan with value[i] = first + i, address 80, status 10, described by its head and its checksum.
struct ScanVector {
  int count;
  int first_value;
  bool has_indices;  ///< bytes 00 01 before the status
  std::size_t size;
  const char* head;  ///< up to and including the header word
  const char* crc;
};

inline constexpr std::array<ScanVector, 7> kScanVectors{{
    {361, 1000, false, 732, "02 80 D6 02 B0 69 41", "86 0C"},
    {181, 1000, false, 372, "02 80 6E 01 B0 B5 40", "B3 BE"},
    {401, 1000, false, 812, "02 80 26 03 B0 91 41", "4E FE"},
    {401, 1000, true, 814, "02 80 28 03 B0 91 41", "15 AA"},
    {101, 100, false, 212, "02 80 CE 00 B0 65 00", "6D 3C"},
    {181, 1000, false, 372, "02 80 6E 01 B0 B5 60", "AB 30"},
    {180, 1000, false, 370, "02 80 6C 01 B0 B4 70", "DD 43"},
}};

}  // namespace rosid::hal::test
