#include "excitation/fft_wisdom.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <new>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "excitation/fft_planner.hpp"
#include "excitation/file_error.hpp"
#include "excitation/fingerprint.hpp"
#include "excitation/output_file.hpp"

namespace stageid {
namespace {

constexpr std::string_view kFormat = "stageid-fft-wisdom 1 ";
constexpr std::size_t kFingerprintDigits = 32;
constexpr std::uintmax_t kMostBytes = 16U << 20U;  // thousands of lengths
constexpr const char* kRemedy = "remove it, or name another, to have plans timed anew";

std::string read_bounded(const std::filesystem::path& file) {
  const auto fail = [&file](const char* what) {
    throw FileError(file.string() + ": " + what + "; give the name of a file to keep FFT plans in");
  };
  if (!std::filesystem::is_regular_file(file)) fail("is not a regular file");
  if (std::filesystem::file_size(file) > kMostBytes)
    throw FormatError(file, "",
                      fmt::format("is no file of FFT plans, which are small; {}", kRemedy));
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) fail("cannot be read");
  return text.str();
}

/// What follows the first line. @throws FormatError
std::string checked_wisdom(const std::filesystem::path& file) {
  const std::string text = read_bounded(file);
  const std::size_t line = kFormat.size() + kFingerprintDigits + 1;
  if (!text.starts_with(kFormat) || text.size() < line)
    throw FormatError(file, "", fmt::format("is no file of FFT plans; {}", kRemedy));
  std::string wisdom = text.substr(line);
  if (text.substr(0, line) != fmt::format("{}{}\n", kFormat, fingerprint_of(wisdom)))
    throw FormatError(file, "", fmt::format("is damaged; {}", kRemedy));
  return wisdom;
}

/// FFTW's wisdom, its entries sorted: their order is that of a hash table.
/// @pre the planner is locked.
std::string sorted_wisdom() {
  const std::unique_ptr<char, void (*)(void*)> text(fftw_export_wisdom_to_string(), &std::free);
  if (!text) throw std::bad_alloc();
  std::istringstream stream(text.get());
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);)
    if (!line.empty()) lines.push_back(line);
  // The first names the version, the last is a closing bracket.
  if (lines.size() > 2) std::sort(lines.begin() + 1, lines.end() - 1);
  return fmt::format("{}\n", fmt::join(lines, "\n"));
}

void use_rule() {
  fftw_forget_wisdom();
  fft_planner().flags = FFTW_ESTIMATE;
}

}  // namespace

FftWisdom::FftWisdom(std::filesystem::path file) : file_(std::move(file)) {
  if (std::filesystem::exists(file_)) {
    kept_ = checked_wisdom(file_);
  } else {
    const OutputFile can_be_made(file_);  // before the long work
  }
  const std::lock_guard guard(fft_planner().lock);
  if (fft_planner().flags != FFTW_ESTIMATE)
    throw std::logic_error("FFT wisdom: there is one already; one program has one set of plans");
  fftw_forget_wisdom();
  if (!kept_.empty() && fftw_import_wisdom_from_string(kept_.c_str()) == 0) {
    use_rule();
    throw FormatError(
        file_, "",
        fmt::format("holds plans of another version of FFTW or kind of processor; {}", kRemedy));
  }
  fft_planner().flags = FFTW_MEASURE;
}

FftWisdom::~FftWisdom() {
  const std::lock_guard guard(fft_planner().lock);
  use_rule();
}

std::string FftWisdom::save() {
  std::string wisdom;
  {
    const std::lock_guard guard(fft_planner().lock);
    wisdom = sorted_wisdom();
  }
  std::string fingerprint = fingerprint_of(wisdom);
  if (wisdom != kept_)
    write_text_file(file_, fmt::format("{}{}\n{}", kFormat, fingerprint, wisdom));
  kept_ = std::move(wisdom);
  return fingerprint;
}

}  // namespace stageid
