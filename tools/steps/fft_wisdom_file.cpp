#include "tools/steps/fft_wisdom_file.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/output_file.hpp"

namespace stageid {
namespace {

constexpr std::string_view kFormat = "stageid-fft-wisdom 1 ";
constexpr std::size_t kFingerprintDigits = 32;
constexpr std::uintmax_t kMostBytes = 16U << 20U;  // enough for thousands of lengths
constexpr const char* kRemedy = "remove it or use another file to time new plans";

std::string read_bounded(const std::filesystem::path& file) {
  const auto fail = [&file](const char* what) {
    throw FileError(file.string() + ": " + what + "; use a file that can store FFT plans");
  };
  if (!std::filesystem::is_regular_file(file)) fail("is not a regular file");
  if (std::filesystem::file_size(file) > kMostBytes)
    fail_format(file, "", "too large for a file of FFT plans; {}", kRemedy);
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) fail("cannot be read");
  return text.str();
}

/// The text after the first line. @throws FormatError
std::string checked_plans(const std::filesystem::path& file) {
  const std::string text = read_bounded(file);
  const std::size_t line = kFormat.size() + kFingerprintDigits + 1;
  if (!text.starts_with(kFormat) || text.size() < line)
    fail_format(file, "", "is not a file of FFT plans; {}", kRemedy);
  std::string plans = text.substr(line);
  if (text.substr(0, line) != fmt::format("{}{}\n", kFormat, fingerprint_of(plans)))
    fail_format(file, "", "is damaged; {}", kRemedy);
  return plans;
}

}  // namespace

FftWisdomFile::FftWisdomFile(std::filesystem::path file) : file_(std::move(file)) {
  if (std::filesystem::exists(file_)) {
    kept_ = checked_plans(file_);
  } else {
    const OutputFile can_be_made(file_);  // checked before the long work
  }
  try {
    wisdom_ = std::make_unique<FftWisdom>(kept_);
  } catch (const std::invalid_argument&) {
    fail_format(file_, "", "contains plans for another FFTW version or processor type; {}",
                kRemedy);
  }
}

std::string FftWisdomFile::save() {
  std::string plans = wisdom_->text();
  std::string fingerprint = fingerprint_of(plans);
  if (plans != kept_) write_text_file(file_, fmt::format("{}{}\n{}", kFormat, fingerprint, plans));
  kept_ = std::move(plans);
  return fingerprint;
}

}  // namespace stageid
