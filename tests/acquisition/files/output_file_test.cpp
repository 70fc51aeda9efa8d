#include "acquisition/files/output_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/file_size_limit.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_output_file {

namespace fs = std::filesystem;
using test::TemporaryDirectory;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

std::size_t entries(const fs::path& directory) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(directory), fs::directory_iterator()));
}

template <typename Action>
void expect_file_error(const Action& action, const fs::path& file, const std::string& word) {
  // The name of the temporary file is one that the user never saw.
  EXPECT_THAT(action,
              ThrowsMessage<FileError>(AllOf(HasSubstr(file.string()), HasSubstr(word),
                                             Not(HasSubstr("\n")), Not(HasSubstr(".tmp")))));
}

TEST(OutputFile, ReplacesTheTargetOnlyWhenCommitted) {
  const TemporaryDirectory directory;
  write_text_file(directory / "out", "old");
  OutputFile output(directory / "out");
  std::ofstream(output.path()) << "new";
  EXPECT_EQ(test::bytes_of(directory / "out"), "old");
  output.commit();
  EXPECT_EQ(test::bytes_of(directory / "out"), "new");
  EXPECT_EQ(entries(directory.path()), 1U) << "the temporary file was left behind";
}

TEST(OutputFile, LeavesNothingBehindWithoutCommit) {
  const TemporaryDirectory directory;
  {
    OutputFile output(directory / "out");
    std::ofstream(output.path()) << "half of";
    EXPECT_EQ(output.path().parent_path(), directory.path()) << "rename must stay on one disk";
    EXPECT_EQ(entries(directory.path()), 1U);
  }
  EXPECT_EQ(entries(directory.path()), 0U);
}

TEST(OutputFile, SeveralOfOneTargetDoNotMeet) {
  const TemporaryDirectory directory;
  OutputFile first(directory / "out");
  OutputFile second(directory / "out");
  EXPECT_NE(first.path(), second.path());
}

TEST(OutputFile, WritesThroughASymbolicLink) {
  const TemporaryDirectory directory;
  fs::create_directory(directory / "far");
  fs::create_symlink(directory / "far/real", directory / "link");
  write_text_file(directory / "link", "text");  // dangling at first
  EXPECT_EQ(test::bytes_of(directory / "far/real"), "text");
  write_text_file(directory / "link", "more");
  EXPECT_EQ(test::bytes_of(directory / "far/real"), "more");
  EXPECT_TRUE(fs::is_symlink(directory / "link"));
  EXPECT_EQ(entries(directory / "far"), 1U);
}

TEST(OutputFile, WritesARelativeNameIntoTheWorkingDirectory) {
  const TemporaryDirectory directory;
  const fs::path before = fs::current_path();
  fs::current_path(directory.path());
  write_text_file("out", "text");
  fs::current_path(before);
  EXPECT_EQ(test::bytes_of(directory / "out"), "text");
}

TEST(OutputFile, RefusesTargetsThatAreNoFiles) {
  const TemporaryDirectory directory;
  const auto create = [](const fs::path& target) { return [target] { OutputFile{target}; }; };
  expect_file_error(create(directory / "absent/out"), directory / "absent/out",
                    std::strerror(ENOENT));
  expect_file_error(create(directory.path()), directory.path(), "is a directory");
  expect_file_error(create("/dev/full"), "/dev/full", "not a regular file");
  expect_file_error(create(directory / "absent/"), directory / "absent/", "file name");
  fs::create_symlink("loop", directory / "loop");
  expect_file_error(create(directory / "loop"), directory / "loop", std::strerror(ELOOP));
  write_text_file(directory / "file", "");
  expect_file_error(create(directory / "file/out"), directory / "file/out", std::strerror(ENOTDIR));
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST(OutputFile, SaysThatADirectoryCannotBeWritten) {
  const TemporaryDirectory directory;
  fs::permissions(directory.path(), fs::perms::owner_read | fs::perms::owner_exec |
                                        fs::perms::others_read | fs::perms::others_exec);
  // Permissions do not restrict root: drop them temporarily.
  constexpr uid_t kNobody = 65534;
  const bool root = ::geteuid() == 0;
  if (root && ::seteuid(kNobody) != 0) GTEST_SKIP() << "cannot step down from root";
  expect_file_error([&] { OutputFile{directory / "out"}; }, directory / "out",
                    std::strerror(EACCES));
  ASSERT_EQ(::seteuid(root ? 0 : ::geteuid()), 0);
  fs::permissions(directory.path(), fs::perms::owner_all);
}

TEST(OutputFile, AFullDiskLeavesTheOldFileAndNothingElse) {
  const TemporaryDirectory directory;
  write_text_file(directory / "out", "old");
  {
    const test::FileSizeLimit limit(1000);
    expect_file_error([&] { write_text_file(directory / "out", std::string(5000, 'x')); },
                      directory / "out", std::strerror(EFBIG));
  }
  EXPECT_EQ(test::bytes_of(directory / "out"), "old");
  EXPECT_EQ(entries(directory.path()), 1U);
}

TEST(OutputFile, CommitSaysThatTheTemporaryFileIsGone) {
  const TemporaryDirectory directory;
  OutputFile output(directory / "out");
  fs::remove(output.path());
  expect_file_error([&] { output.commit(); }, directory / "out", std::strerror(ENOENT));
}

}  // namespace stageid::test_output_file
