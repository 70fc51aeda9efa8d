// Kinds of files are determined by content alone, not by names or extensions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <fstream>
#include <string>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/system_reason.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_file_kind {

using testing::StartsWith;

struct FileKind : testing::Test {
  std::string kind_of(std::string_view bytes) {
    std::ofstream(directory_ / "file", std::ios::binary) << bytes;
    return other_kind(directory_ / "file", "a cat");
  }

  test::TemporaryDirectory directory_;
};

TEST_F(FileKind, IsToldByTheFirstBytes) {
  using std::string_view_literals::operator""sv;
  EXPECT_EQ(kind_of("\x89SLOG\r\n\x1a\0"sv),
            "is a native log, not a cat; use it with 'stageid frf', 'validate', 'report' or 'log'");
  EXPECT_THAT(kind_of("MATLAB 5.0 MAT-file"),
              StartsWith("is a MATLAB file, not a cat; convert it with 'stageid im"));
  EXPECT_THAT(kind_of("PK\x03\x04..."), StartsWith("is a ZIP archive (possibly .npz), not a cat;"));
  EXPECT_THAT(kind_of("    -1\n   151\n"), StartsWith("is a universal file, not a cat;"));
  EXPECT_THAT(kind_of("<!DOCTYPE html>"), StartsWith("is an HTML page, not a cat;"));
  EXPECT_THAT(kind_of("{}"), StartsWith("is JSON, not a cat;"));
  // A damaged HDF5 file still has the signature.
  EXPECT_THAT(kind_of("\x89HDF\r\n\x1a\n..."), StartsWith("is an HDF5 file of another program,"));
  EXPECT_EQ(kind_of("frequency, response\n"), "");
  EXPECT_EQ(kind_of(""), "");
  EXPECT_EQ(other_kind(directory_ / "none", "a cat"), "");
}

TEST_F(FileKind, IsWhatAFileOfOursSays) {
  EXPECT_THAT(kind_of("{\n  \"format\": \"stageid-model\",\n"),
              StartsWith("is a model, not a cat;"));
  EXPECT_THAT(kind_of("{\"format\":\"stageid-modes\"}"),
              StartsWith("is a list of modes, not a cat;"));
  EXPECT_THAT(kind_of("# mine\nformat: stageid-stage\n"),
              StartsWith("is a stage file, not a cat;"));
  EXPECT_THAT(kind_of("format: stageid-experiment"),
              StartsWith("is an experiment file, not a cat;"));
  // The word in another place is not a format.
  EXPECT_EQ(kind_of("the format: stageid-stage is YAML"), "");
  for (const auto& [format, kind] : {std::pair{"stageid-log", "is a log in HDF5,"},
                                     {"stageid-frf", "is a frequency response,"},
                                     {"stageid-excitation", "is a designed excitation,"},
                                     {"stageid-model", "is an exported model,"}}) {
    Hdf5File file = Hdf5File::create(directory_ / "file", directory_ / "file");
    file.write_attribute("/", "format", std::string(format));
    file.close();
    EXPECT_THAT(other_kind(directory_ / "file", "a cat"), StartsWith(kind));
    EXPECT_THAT(other_hdf5_kind(format, "a cat"), StartsWith(kind));
  }
  EXPECT_EQ(other_hdf5_kind("another", "a cat"), "");
}

TEST(SystemReason, SaysWhatToDo) {
  EXPECT_EQ(system_reason(ENOSPC), "No space left on device; free some space, or write elsewhere");
  EXPECT_EQ(with_remedy("unable to write: Permission denied"),
            "unable to write: Permission denied; check the permissions");
  EXPECT_EQ(with_remedy("file signature not found"), "file signature not found");
}

TEST(ShownName, IsThatOfTheOutput) {
  EXPECT_EQ(shown_name("dir/.frf.h5.17.3.tmp"), "dir/frf.h5");
  EXPECT_EQ(shown_name("..m.mat.17.0.tmp.17.1.tmp"), "m.mat");
  EXPECT_EQ(shown_name(".hidden.mat"), ".hidden.mat");
  const test::TemporaryDirectory directory;
  const OutputFile output(directory / "m.mat");
  EXPECT_EQ(shown_name(output.path()), directory / "m.mat");
}

TEST(Counted, OneHasNoS) {
  EXPECT_EQ(counted(1, "experiment"), "1 experiment");
  EXPECT_EQ(counted(0U, "experiment"), "0 experiments");
  EXPECT_EQ(counted(2L, "axis", "axes"), "2 axes");
  EXPECT_EQ(counted(1, "axis", "axes"), "1 axis");
  const std::vector<std::string> three = {"a", "b", "c"};
  EXPECT_EQ(listed(three, 3), "a, b, c");
  EXPECT_EQ(listed(three, 2), "a, b and 1 more");
  EXPECT_EQ(listed({}, 2), "");
}

}  // namespace stageid::test_file_kind
