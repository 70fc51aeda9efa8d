// docs/formats.md describes the file, excitation.h5.

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/hdf5_matrices.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "excitation/multisine/multisine_lines.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr const char* kFormat = "stageid-excitation";
constexpr long long kVersion = 1;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string realization_group(int realization) {
  return fmt::format("/realizations/{:04}", realization);
}

// Writing --------------------------------------------------------------------------------------

void write_spec(Hdf5File& file, const ExperimentPlan& plan) {
  const ExperimentSpec& spec = plan.spec();
  const auto integer = [&file](const char* name, long long value) {
    file.write_attribute("/", name, value);
  };
  file.write_attribute("/", "format", std::string(kFormat));
  integer("format_version", kVersion);
  file.write_attribute("/", "sample_rate_hz", plan.grid().sample_rate_hz());
  integer("period_samples", plan.grid().samples_per_period());
  file.write_attribute("/", "scheme", std::string(to_string(spec.scheme)));
  file.write_attribute("/", "scaling", std::string(to_string(spec.scaling)));
  integer("realizations", spec.realizations);
  integer("periods", spec.periods);
  integer("transient_periods", spec.transient_periods);
  integer("crest_iterations", spec.crest_iterations);
  file.write_attribute("/", "seed", std::to_string(spec.seed));
}

void write_axes(Hdf5File& file, const ExperimentPlan& plan) {
  const FrequencyGrid& grid = plan.grid();
  write_vector(file, "/lines", std::vector<long long>(grid.lines().begin(), grid.lines().end()));
  write_vector(file, "/frequency_hz", grid.frequency_hz());

  std::vector<std::string> channels;
  std::vector<double> levels;
  MatrixXd shape = MatrixXd::Zero(plan.axes(), grid.size());
  MatrixXd phase_rad = MatrixXd::Constant(plan.axes(), grid.size(), kNaN);
  for (const ExcitationAxis& axis : plan.spec().axes) {
    const auto row = static_cast<Index>(channels.size());
    if (axis.shape.size() > 0) shape.row(row) = axis.shape.transpose();
    if (axis.phase_rad.size() > 0) phase_rad.row(row) = axis.phase_rad.transpose();
    channels.push_back(axis.channel);
    levels.push_back(axis.level);
  }
  file.write_texts("/axes", channels);
  write_vector(file, "/level", levels);
  if (!shape.isZero(0.0)) write_matrix(file, "/shape", shape);
  if (!phase_rad.array().isNaN().all()) write_matrix(file, "/phase_rad", phase_rad);
}

MatrixXcd unmixed_spectrum(const MatrixXd& amplitude, const MatrixXd& phase_rad) {
  return axis_coefficients(Eigen::VectorXcd::Ones(amplitude.rows()), amplitude, phase_rad);
}

// Reading --------------------------------------------------------------------------------------

[[noreturn]] void fail(const Hdf5File& file, const std::string& place, const std::string& what) {
  throw FormatError(file.path(), place, what);
}

int read_integer(const Hdf5File& file, const char* name, int least) {
  const long long value = file.read_integer_attribute("/", name);
  if (value < least || value > std::numeric_limits<int>::max())
    fail(file, "/", fmt::format("attribute '{}' is {}; must be at least {}", name, value, least));
  return static_cast<int>(value);
}

template <typename Scalar = double>
Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> read_matrix(const Hdf5File& file,
                                                                  const std::string& dataset,
                                                                  Index rows, Index columns) {
  require_shape(file, dataset, {static_cast<hsize_t>(rows), static_cast<hsize_t>(columns)});
  const std::vector<Scalar> values = read_array<Scalar>(file, dataset);
  return Eigen::Map<const RowMajor<Scalar>>(values.data(), rows, columns);
}

FrequencyGrid read_grid(const Hdf5File& file) {
  const std::vector<double> numbers = file.read_reals("/lines");
  std::vector<int> lines;
  for (const double number : numbers) {
    if (!(number >= 1.0 && number <= std::numeric_limits<int>::max()) ||
        number != std::floor(number)) {
      fail(file, "/lines", fmt::format("contains {}; expected positive integers", number));
    }
    lines.push_back(static_cast<int>(number));
  }
  return {file.read_real_attribute("/", "sample_rate_hz"), read_integer(file, "period_samples", 3),
          std::move(lines)};
}

template <typename Enum>
Enum read_word(const Hdf5File& file, const char* attribute) {
  const std::string word = file.read_text_attribute("/", attribute);
  if (const auto value = from_word<Enum>(word)) return *value;
  fail(file, "/",
       fmt::format("attribute '{}' is '{}'; must be {}", attribute, word, one_of(kWords<Enum>)));
}

std::uint64_t read_seed(const Hdf5File& file) {
  const std::string text = file.read_text_attribute("/", "seed");
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  if (error != std::errc() || end != text.data() + text.size())
    fail(file, "/", "attribute 'seed' is '" + text + "'; expected an unsigned decimal number");
  return seed;
}

std::vector<ExcitationAxis> read_axes(const Hdf5File& file, const FrequencyGrid& grid) {
  const std::vector<std::string> channels = file.read_texts("/axes");
  const auto count = static_cast<Index>(channels.size());
  require_shape(file, "/level", {channels.size()});
  const std::vector<double> levels = file.read_reals("/level");
  const MatrixXd shape = file.exists("/shape") ? read_matrix(file, "/shape", count, grid.size())
                                               : MatrixXd::Zero(count, grid.size());
  const MatrixXd phase_rad = file.exists("/phase_rad")
                                 ? read_matrix(file, "/phase_rad", count, grid.size())
                                 : MatrixXd::Constant(count, grid.size(), kNaN);
  std::vector<ExcitationAxis> axes;
  for (Index p = 0; p < count; ++p) {
    axes.push_back({channels[p], levels[p], {}, {}});
    if (!phase_rad.row(p).array().isNaN().all())
      axes.back().phase_rad = phase_rad.row(p).transpose();
    if (!shape.row(p).isZero(0.0)) axes.back().shape = shape.row(p).transpose();
  }
  return axes;
}

ExperimentSpec read_spec(const Hdf5File& file, const FrequencyGrid& grid) {
  ExperimentSpec spec;
  spec.scaling = read_word<AmplitudeScaling>(file, "scaling");
  spec.scheme = read_word<ExcitationScheme>(file, "scheme");
  spec.axes = read_axes(file, grid);
  spec.realizations = read_integer(file, "realizations", 1);
  spec.periods = read_integer(file, "periods", 1);
  spec.transient_periods = read_integer(file, "transient_periods", 0);
  spec.crest_iterations = read_integer(file, "crest_iterations", 0);
  spec.seed = read_seed(file);
  const std::size_t stored = file.children("/realizations").size();
  if (stored != static_cast<std::size_t>(spec.realizations))
    fail(file, "/realizations",
         fmt::format("contains {} realizations; expected {} according to attribute 'realizations'",
                     stored, spec.realizations));
  return spec;
}

std::vector<MatrixXd> read_phases(const Hdf5File& file, const ExperimentSpec& spec,
                                  const FrequencyGrid& grid) {
  const auto axes = static_cast<Index>(spec.axes.size());
  constexpr double kTurn = 2.0 * std::numbers::pi;
  std::vector<MatrixXd> phases;
  for (int m = 0; m < spec.realizations; ++m) {
    const std::string dataset = realization_group(m) + "/phase_rad";
    phases.push_back(read_matrix(file, dataset, axes, grid.size()));
    const auto values = phases.back().array();
    if (!(values >= 0.0 && values < kTurn).all())
      fail(file, dataset,
           "contains phases that are out of range (0 to 2 pi) or NaN; run 'stageid design' again");
  }
  return phases;
}

void check_agrees(const Hdf5File& file, const ExperimentPlan& plan) {
  // Far above the rounding of other machines, far below any relevant change.
  constexpr double kTolerance = 1e-9;
  const auto check = [&file](const auto& stored, const auto& wanted, const std::string& dataset) {
    const double largest = wanted.cwiseAbs().maxCoeff();
    const double difference = (stored - wanted).cwiseAbs().maxCoeff();
    if (!stored.allFinite() || !(difference <= kTolerance * largest))
      fail(file, dataset,
           "does not match the seed and the other fields of this file, which was altered or is "
           "damaged; run 'stageid design' again");
  };
  const Index axes = plan.axes();
  const Index lines = plan.grid().size();
  check(read_matrix(file, "/amplitude", axes, lines), plan.amplitude(), "/amplitude");
  check(read_matrix<std::complex<double>>(file, "/mixing", axes, plan.experiments()), plan.mixing(),
        "/mixing");
  for (int m = 0; m < plan.spec().realizations; ++m) {
    const std::string group = realization_group(m);
    const MatrixXd phase_rad = plan.phase_rad(m);
    check(read_matrix(file, group + "/phase_rad", axes, lines), phase_rad, group + "/phase_rad");
    check(read_matrix<std::complex<double>>(file, group + "/spectrum", axes, lines),
          unmixed_spectrum(plan.amplitude(), phase_rad), group + "/spectrum");
  }
}

}  // namespace

void write_experiment_plan(const std::filesystem::path& file, const ExperimentPlan& plan) {
  OutputFile output(file);
  Hdf5File hdf5 = Hdf5File::create(output.path(), file);
  write_spec(hdf5, plan);
  write_axes(hdf5, plan);
  write_matrix(hdf5, "/amplitude", plan.amplitude());
  write_matrix(hdf5, "/mixing", plan.mixing());
  for (int m = 0; m < plan.spec().realizations; ++m) {
    const std::string group = realization_group(m);
    const MatrixXd phase_rad = plan.phase_rad(m);
    hdf5.create_group(group);
    write_matrix(hdf5, group + "/phase_rad", phase_rad);
    write_matrix(hdf5, group + "/spectrum", unmixed_spectrum(plan.amplitude(), phase_rad));
  }
  hdf5.close();
  output.commit();
}

ExperimentPlan read_experiment_plan(const std::filesystem::path& file) {
  const Hdf5File hdf5 = Hdf5File::open(file);
  require_format(hdf5, kFormat, "a designed excitation");
  require_version(hdf5, kVersion);
  try {
    FrequencyGrid grid = read_grid(hdf5);
    ExperimentSpec spec = read_spec(hdf5, grid);
    // Reduced phases are read from the file: on another machine, hundreds of transforms with other rounding may
    // have converged elsewhere.
    std::vector<MatrixXd> reduced;
    if (spec.crest_iterations > 0) reduced = read_phases(hdf5, spec, grid);
    ExperimentPlan plan(std::move(grid), std::move(spec), std::move(reduced));
    check_agrees(hdf5, plan);
    return plan;
  } catch (const std::invalid_argument& e) {
    throw FormatError(file, "", std::string(e.what()) + "; run 'stageid design' again");
  }
}

}  // namespace stageid
