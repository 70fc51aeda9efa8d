#include "tools/terminal/interrupt.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>

#include "acquisition/files/output_file.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tools/terminal/exit_code.hpp"

namespace stageid::test_interrupt {

/// Ends by the signal; a file is being written, and the function for the end writes another one.
[[noreturn]] void end_while_writing(const test::TemporaryDirectory& directory) {
  std::signal(SIGINT, SIG_DFL);  // a shell ignores it for what it starts in the background
  catch_signals();
  const OutputFile unfinished(directory / "unfinished");
  const CleanedUpAtInterrupt clean_up([&] { write_text_file(directory / "farewell", "end"); });
  ::kill(::getpid(), SIGINT);
  for (;;) ::pause();
}

TEST(InterruptDeathTest, WhatIsDoneAtTheEndMayWaitForAnOutput) {
  const test::TemporaryDirectory directory;
  EXPECT_EXIT(end_while_writing(directory), testing::ExitedWithCode(kInterrupted),
              "stageid: interrupted; nothing was written");
}

}  // namespace stageid::test_interrupt
