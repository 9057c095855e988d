// The functions of the C library that libusb reaches the kernel with: those that concern the played bus go there.

#include <dlfcn.h>

#include <cstdarg>

#include "tests/unit/hal/usb_bus.hpp"

extern "C" {

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): the sanitizers'
// umockdev stands between the program and the C library; that it does so later than the sanitizer is all right.
const char* __asan_default_options();
const char* __asan_default_options() {
  return "verify_asan_link_order=0";
}
// Threads of umockdev and libusb lock and close descriptors where the sanitizer cannot see it.
const char* __tsan_default_suppressions();
const char* __tsan_default_suppressions() {
  return "called_from_lib:libglib-2.0.so\ncalled_from_lib:libumockdev.so\ncalled_from_lib:libumockdev-preload.so\n"
         "called_from_lib:libudev.so\ncalled_from_lib:libusb-1.0.so\n";
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

// NOLINTNEXTLINE(cert-dcl50-cpp,readability-inconsistent-declaration-parameter-name): the C library's
int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  using namespace rosid::hal::test;
  constexpr unsigned long kTypeShift = 8;
  if (((request >> kTypeShift) & 0xFFU) == 'U' && UsbBus::current().load() != nullptr) {
    if (auto* adapter = UsbBus::current().load()->with_descriptor(fd)) { return adapter->on_ioctl(request, argument); }
  }
  using Function = int (*)(int, unsigned long, ...);
  static const auto kReal = reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "ioctl"));
  return kReal(fd, request, argument);
}

/// What open() is in a library that was built with checks.
// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming): the C library's
int __open_2(const char* path, int flags) {
  using namespace rosid::hal::test;
  if (UsbBus::current().load() != nullptr) {
    if (auto* adapter = UsbBus::current().load()->with_node(path)) { return adapter->on_open(); }
  }
  using Function = int (*)(const char*, int);
  static const auto kReal = reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "__open_2"));
  return kReal(path, flags);
}

int close(int fd) {
  using namespace rosid::hal::test;
  if (UsbBus::current().load() != nullptr) {
    if (auto* adapter = UsbBus::current().load()->with_descriptor(fd)) { adapter->on_close(); }
  }
  using Function = int (*)(int);
  static const auto kReal = reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "close"));
  return kReal(fd);
}

}  // extern "C"
