#pragma once
// The running program. run() builds exactly this picture:
//
//   laser, CAN bus
//        |                                                        estimates, aids, hand-overs
//   [I/O thread]  -- samples -->  [estimator thread]  ------------------------------------------.
//     FIFO 45     -- lines, angles --.    FIFO 40    ^ fixes                                     |
//        |                           |       | poses |                                           v
//        |                           '--> [mapping thread]  -- views, maps -------------->  [output: main thread]
//        '-- raw bytes, lines, health ------------------------------------------------------->  LCM, files, log
//
// Arrows are bounded queues with one producer and one consumer, or cells that hold the latest value (channels.hpp).

#include <filesystem>
#include <memory>

#include "base/result.hpp"
#include "config/loader.hpp"
#include "daemon/estimator_thread.hpp"
#include "daemon/journal.hpp"
#include "daemon/state_directory.hpp"

namespace rosid::daemon {

class App {
 public:
  struct Options {
    config::RosidConfig config;
    int journal_fd = 2;
    bool journal_prefixes = false;
    // Test seams; empty in the program.
    CycleHook io_hook;
    CycleHook estimator_hook;
    CycleHook mapping_hook;
  };
  enum class End : std::uint8_t {
    Clean,      ///< everything stored
    Unstored,   ///< some file could not be written; the log said which
    Abandoned,  ///< as Clean, but the mapping thread was still busy with a view: leave by std::_Exit()
  };

  explicit App(Options options);

  /// Runs until stop_fd can be read (a signalfd, an eventfd). At most two seconds later it returns. Errors, before any
  /// thread is left running: the state directory cannot be used or is in use, real-time scheduling is required but
  /// refused.
  Result<End> run(int stop_fd);

 private:
  void warn_about_realtime(int error, bool is_memory);

  Options options_;
  Journal journal_;
};

}  // namespace rosid::daemon
