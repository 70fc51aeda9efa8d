#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test {

/// A directory and scripts in it that read our files with another program. Skipped if Python lacks the packages.
class PythonScriptTest : public testing::Test {
 protected:
  explicit PythonScriptTest(std::string packages = "h5py, numpy as np")
      : packages_(std::move(packages)) {}

  void SetUp() override {
    const std::string probe = kPython + (" -c 'import " + packages_) + "' 2> /dev/null";
    if (std::system(probe.c_str()) != 0) GTEST_SKIP() << kPython << " has not all of " << packages_;
  }

  /// Runs a script in the directory, behind the import of the packages; it fails by an assertion.
  void run(const std::string& script) const {
    std::ofstream(directory / "script.py") << "import " << packages_ << "\n" << script;
    const std::string command =
        "cd '" + directory.path().string() + "' && " + kPython + " script.py > output.txt 2>&1";
    const int status = std::system(command.c_str());
    std::ifstream output(directory / "output.txt");
    EXPECT_EQ(status, 0) << std::string(std::istreambuf_iterator<char>(output), {});
  }

  TemporaryDirectory directory;

 private:
  inline static const std::string kPython = "/usr/bin/python3";
  std::string packages_;
};

}  // namespace stageid::test
