#pragma once

#include <gtest/gtest.h>

#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test {

/// A test with an empty directory of its own.
struct DirectoryTest : testing::Test {
  TemporaryDirectory directory_;
};

}  // namespace stageid::test
