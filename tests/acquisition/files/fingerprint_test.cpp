#include "acquisition/files/fingerprint.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_fingerprint {

// Computed by XXH3_128bits() of libxxhash 0.8.1, called from Python.
constexpr const char* kOfNothing = "99aa06d3014798d86001c324468d497f";
constexpr const char* kOfStageid = "24bd61dcccab292da82a926c0c65825f";

TEST(Fingerprint, IsXxh3Of128Bits) {
  EXPECT_EQ(fingerprint_of(""), kOfNothing);
  EXPECT_EQ(fingerprint_of("stageid\n"), kOfStageid);
}

TEST(Fingerprint, SeesTheStreamNotItsPieces) {
  Fingerprint fingerprint;
  fingerprint.add("sta");
  fingerprint.add(std::string_view());
  fingerprint.add("geid\n");
  EXPECT_EQ(fingerprint.hex(), kOfStageid);
  EXPECT_EQ(fingerprint.hex(), kOfStageid) << "asking must not change it";
}

TEST(Fingerprint, OfAFileIsThatOfItsBytes) {
  const test::TemporaryDirectory directory;
  const std::string text(3'000'001, 'x');  // several blocks and a remainder
  std::ofstream(directory / "file", std::ios::binary) << text;
  EXPECT_EQ(fingerprint_of_file(directory / "file"), fingerprint_of(text));

  std::string changed = text;
  changed[2'999'999] = 'y';
  std::ofstream(directory / "file", std::ios::binary) << changed;
  EXPECT_NE(fingerprint_of_file(directory / "file"), fingerprint_of(text));
}

TEST(Fingerprint, SaysWhichFileCannotBeRead) {
  const test::TemporaryDirectory directory;
  for (const auto& file : {directory / "absent", directory.path()})
    test::expect_error<FileError>([&] { fingerprint_of_file(file); }, file, "cannot be read");
}

}  // namespace stageid::test_fingerprint
