#include "excitation/multisine/fft_wisdom.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <new>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "excitation/multisine/fft_planner.hpp"

namespace stageid {
namespace {

/// @pre the planner is locked.
void use_rule() {
  fftw_forget_wisdom();
  fft_planner().flags = FFTW_ESTIMATE;
}

}  // namespace

FftWisdom::FftWisdom(const std::string& plans) {
  const std::lock_guard guard(fft_planner().lock);
  if (fft_planner().flags != FFTW_ESTIMATE)
    throw std::logic_error("FFT plans: already loaded; a program can load only one set of plans");
  fftw_forget_wisdom();
  if (!plans.empty() && fftw_import_wisdom_from_string(plans.c_str()) == 0) {
    use_rule();
    throw std::invalid_argument(
        "the FFT plans belong to a different FFTW version or processor type");
  }
  fft_planner().flags = FFTW_MEASURE;
}

FftWisdom::~FftWisdom() {
  const std::lock_guard guard(fft_planner().lock);
  use_rule();
}

std::string FftWisdom::text() const {
  const std::lock_guard guard(fft_planner().lock);
  const std::unique_ptr<char, void (*)(void*)> exported(fftw_export_wisdom_to_string(), &std::free);
  if (!exported) throw std::bad_alloc();
  std::istringstream stream(exported.get());
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);)
    if (!line.empty()) lines.push_back(line);
  // The entries are in hash-table order. The first line is the version, the last a closing bracket.
  if (lines.size() > 2) std::sort(lines.begin() + 1, lines.end() - 1);
  return fmt::format("{}\n", fmt::join(lines, "\n"));
}

}  // namespace stageid
