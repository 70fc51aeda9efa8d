#include "acquisition/files/output_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "tests/support/process/directory_test.hpp"
#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/file_size_limit.hpp"

namespace stageid::test_output_file {

namespace fs = std::filesystem;
std::size_t entries(const fs::path& directory) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(directory), fs::directory_iterator()));
}

void expect_file_error(const std::function<void()>& action, const fs::path& file,
                       const std::string& word) {
  using testing::AllOf, testing::HasSubstr, testing::Not;
  // The name of the temporary file is one that the user never saw.
  EXPECT_THAT(action, testing::ThrowsMessage<FileError>(AllOf(HasSubstr(file.string()),
                                                              HasSubstr(word), Not(HasSubstr("\n")),
                                                              Not(HasSubstr(".tmp")))));
}

void expect_refused(const fs::path& target, const std::string& word) {
  expect_file_error([&] { OutputFile{target}; }, target, word);
}

using OutputFileTest = test::DirectoryTest;

TEST_F(OutputFileTest, ReplacesTheTargetOnlyWhenCommitted) {
  write_text_file(directory_ / "out", "old");
  OutputFile output(directory_ / "out");
  std::ofstream(output.path()) << "new";
  EXPECT_EQ(test::read_bytes(directory_ / "out"), "old");
  output.commit();
  EXPECT_EQ(test::read_bytes(directory_ / "out"), "new");
  EXPECT_EQ(entries(directory_.path()), 1U) << "the temporary file was left behind";
}

TEST_F(OutputFileTest, LeavesNothingBehindWithoutCommit) {
  {
    OutputFile output(directory_ / "out");
    std::ofstream(output.path()) << "half of";
    EXPECT_EQ(output.path().parent_path(), directory_.path()) << "rename must stay on one disk";
    EXPECT_NE(OutputFile(directory_ / "out").path(), output.path());
    EXPECT_EQ(entries(directory_.path()), 1U);
  }
  EXPECT_EQ(entries(directory_.path()), 0U);
}

TEST_F(OutputFileTest, WritesThroughASymbolicLink) {
  fs::create_directory(directory_ / "far");
  fs::create_symlink(directory_ / "far/real", directory_ / "link");
  write_text_file(directory_ / "link", "text");  // dangling at first
  EXPECT_EQ(test::read_bytes(directory_ / "far/real"), "text");
  write_text_file(directory_ / "link", "more");
  EXPECT_EQ(test::read_bytes(directory_ / "far/real"), "more");
  EXPECT_TRUE(fs::is_symlink(directory_ / "link"));
  EXPECT_EQ(entries(directory_ / "far"), 1U);
}

TEST_F(OutputFileTest, WritesARelativeNameIntoTheWorkingDirectory) {
  const fs::path before = fs::current_path();
  fs::current_path(directory_.path());
  write_text_file("out", "text");
  fs::current_path(before);
  EXPECT_EQ(test::read_bytes(directory_ / "out"), "text");
}

TEST_F(OutputFileTest, RefusesTargetsThatAreNoFiles) {
  expect_refused(directory_ / "absent/out", std::strerror(ENOENT));
  expect_refused(directory_.path(), "is a directory");
  expect_refused("/dev/full", "not a regular file");
  expect_refused(directory_ / "absent/", "file name");
  fs::create_symlink("loop", directory_ / "loop");
  expect_refused(directory_ / "loop", std::strerror(ELOOP));
  write_text_file(directory_ / "file", "");
  expect_refused(directory_ / "file/out", std::strerror(ENOTDIR));
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(OutputFileTest, SaysThatADirectoryCannotBeWritten) {
  fs::permissions(directory_.path(), fs::perms::owner_read | fs::perms::owner_exec |
                                         fs::perms::others_read | fs::perms::others_exec);
  // Permissions do not restrict root: drop them temporarily.
  constexpr uid_t kNobody = 65534;
  const bool root = ::geteuid() == 0;
  if (root && ::seteuid(kNobody) != 0) GTEST_SKIP() << "cannot step down from root";
  expect_refused(directory_ / "out", std::strerror(EACCES));
  ASSERT_EQ(::seteuid(root ? 0 : ::geteuid()), 0);
  fs::permissions(directory_.path(), fs::perms::owner_all);
}

TEST_F(OutputFileTest, AFullDiskLeavesTheOldFileAndNothingElse) {
  write_text_file(directory_ / "out", "old");
  {
    const test::FileSizeLimit limit(1000);
    expect_file_error([&] { write_text_file(directory_ / "out", std::string(5000, 'x')); },
                      directory_ / "out", std::strerror(EFBIG));
  }
  EXPECT_EQ(test::read_bytes(directory_ / "out"), "old");
  EXPECT_EQ(entries(directory_.path()), 1U);
}

TEST_F(OutputFileTest, CommitSaysThatTheTemporaryFileIsGone) {
  OutputFile output(directory_ / "out");
  fs::remove(output.path());
  expect_file_error([&] { output.commit(); }, directory_ / "out", std::strerror(ENOENT));
}

}  // namespace stageid::test_output_file
