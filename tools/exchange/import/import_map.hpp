#pragma once

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "excitation/words/words.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The meaning of the arrays of a foreign file. Names are those of variables, datasets or columns; fields of structs
/// are "struct/field" or "struct.field". In names of files and of arrays of a log, {realization} and {experiment} are
/// placeholders for numbers.
struct ImportMap {
  enum class Kind : std::uint8_t { frf, log };
  enum class FrequencyUnit : std::uint8_t { hz, rad_s };
  enum class FileSampleRate : std::uint8_t { checked, ignored };
  enum class ExcitationPeriod : std::uint8_t { repeats, mean };

  /// One channel of a response that is not in one array: values, real and imaginary part, or magnitude and phase.
  struct Channel {
    std::string output, input;
    std::string response, real, imaginary, magnitude, phase_deg;
    std::string noise_variance, total_variance;  ///< of all channels or of none
  };
  /// A group of channels of a log: arrays of samples, or of samples x channels.
  struct Signals {
    std::vector<std::string> arrays;
    std::vector<std::string> names;  ///< empty: those of the arrays
    std::string unit;                ///< see units_of()
    std::vector<double> scale;       ///< empty: 1; unit = scale x number in the file
    std::vector<std::string>
        axes;  ///< of every array: sample, channel, realization, experiment, run
  };
  struct Run {
    std::int64_t realization = 0, experiment = 0, first_row = 0;
    std::int64_t rows = 0;  ///< 0: to the end
  };

  /// A number, or the variable of the file with that number.
  struct Scalar {
    std::optional<double> number;
    std::string variable;
    bool empty() const noexcept { return !number && variable.empty(); }
  };

  std::filesystem::path file;
  std::string files;  ///< pattern of the files, one or more runs each; relative to the map
  Kind kind = Kind::frf;
  double sample_rate_hz = 0.0;  ///< 0: unknown; a log then uses that of the file
  FileSampleRate file_sample_rate = FileSampleRate::checked;

  std::string frequency;
  Scalar first_hz, step_hz;  ///< instead of `frequency`
  FrequencyUnit frequency_unit = FrequencyUnit::hz;
  Hold hold = Hold::none;
  std::string response, response_imaginary, noise_variance, total_variance;
  std::vector<std::string> axes;
  std::vector<std::string> inputs, outputs;
  std::string input_unit, output_unit;  ///< see units_of()
  std::vector<Channel> channels;

  std::int64_t period_samples = 0, transient_periods = 0;
  Signals excitation, actuators, sensors;
  ExcitationPeriod excitation_period = ExcitationPeriod::repeats;
  std::vector<Run> runs;

  /// The groups of a log by their keys.
  std::vector<std::pair<const char*, const Signals*>> groups() const {
    return {{"excitation", &excitation}, {"actuators", &actuators}, {"sensors", &sensors}};
  }
};
template <>
inline constexpr std::array kWords<ImportMap::Kind> = {"frf", "log"};
template <>
inline constexpr std::array kWords<ImportMap::FrequencyUnit> = {"Hz", "rad/s"};
template <>
inline constexpr std::array kWords<ImportMap::FileSampleRate> = {"checked", "ignored"};
template <>
inline constexpr std::array kWords<ImportMap::ExcitationPeriod> = {"repeats", "mean"};

/// The units of `count` channels from the text of a map: one for all, or one per channel, separated by blanks; empty:
/// 1.
/// @throws FormatError naming the map and `key`.
std::vector<std::string> units_of(const ImportMap& map, const char* key, const std::string& words,
                                  std::size_t count);

/// @throws FileError, FormatError "FILE:LINE:COLUMN: ..."
ImportMap read_import_map(const std::filesystem::path& file);

/// @throws FormatError naming the map's file, always
template <typename... Parts>
[[noreturn]] void refuse_map(const ImportMap& map, fmt::format_string<Parts...> what,
                             Parts&&... parts) {
  fail_format(map.file, "", what, std::forward<Parts>(parts)...);
}

}  // namespace stageid
