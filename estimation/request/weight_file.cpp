#include "estimation/request/weight_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "estimation/problem/weight_matrices.hpp"

namespace stageid {
namespace {

constexpr const char* kDiagonals = "/weights";
constexpr const char* kMatrices = "/weight_matrices";

constexpr double kLeastPower = 1e-100;

/// @param wanted shape on the lines of the band  @returns the first line of the band in the dataset
std::size_t first_line(const Hdf5File& file, const char* dataset,
                       const std::vector<hsize_t>& wanted, WholeLines whole) {
  const std::vector<hsize_t> shape = file.shape(dataset);
  if (shape == wanted) return 0;
  std::vector<hsize_t> of_whole = wanted;
  of_whole[0] = static_cast<hsize_t>(whole.count);
  if (shape == of_whole) return static_cast<std::size_t>(whole.first);
  fail_format(file.path(), dataset, "has the shape {}; expected {}, as the response in the band",
              fmt::join(shape, " x "), fmt::join(wanted, " x "));
}

IndefiniteWeights indefinite(const Hdf5File& file, const char* dataset, const std::string& what) {
  return IndefiniteWeights(fmt::format("{}:{}: {}", file.path().string(), dataset, what));
}

void read_diagonals(const Hdf5File& file, const FrfEstimate& frf, WholeLines whole,
                    Eigen::MatrixXd& weights) {
  const std::size_t first =
      first_line(file, kDiagonals,
                 {static_cast<hsize_t>(frf.lines()), static_cast<hsize_t>(frf.n_outputs()),
                  static_cast<hsize_t>(frf.n_inputs())},
                 whole);
  const std::vector<double> values = file.read_reals(kDiagonals);
  weights.resize(frf.n_outputs() * frf.n_inputs(), frf.lines());
  std::size_t at = first * static_cast<std::size_t>(weights.rows());
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    for (Eigen::Index i = 0; i < frf.n_outputs(); ++i)
      for (Eigen::Index j = 0; j < frf.n_inputs(); ++j, ++at) {
        if (!std::isfinite(values[at]))
          fail_format(file.path(), kDiagonals, "line {}: {}; weights must be finite", k,
                      values[at]);
        if (values[at] < 0.0)
          throw indefinite(file, kDiagonals,
                           fmt::format("line {}: {}; weights must be 0 or more", k, values[at]));
        weights(i + frf.n_outputs() * j, k) = values[at];
      }
  if (!(weights.maxCoeff() > 0.0))
    throw FormatError(file.path(), kDiagonals, "all weights are 0; at least one must be positive");
  // With larger numbers, squares exceed the range of doubles.
  const double power = (weights.array() * frf.response.cwiseAbs2().array()).sum();
  if (power > 0.0 && !(power > kLeastPower && power < 1.0 / kLeastPower))
    fail_format(file.path(), kDiagonals,
                "the weighted power of the response, sum W |G|^2, is {:.1e}; only "
                "the ratios of weights matter: scale them until it is about 1",
                power);
}

void read_matrices(const Hdf5File& file, const FrfEstimate& frf, WholeLines whole,
                   Eigen::MatrixXcd& matrices) {
  const Eigen::Index n_c = frf.n_outputs() * frf.n_inputs();
  const auto first = static_cast<Eigen::Index>(first_line(
      file, kMatrices,
      {static_cast<hsize_t>(frf.lines()), static_cast<hsize_t>(n_c), static_cast<hsize_t>(n_c)},
      whole));
  try {
    require_memory_for_weight_matrices(n_c, frf.lines());
    // Rows of a Hermitian matrix are its columns, conjugated; other matrices are rejected.
    const std::vector<std::complex<double>> values = file.read_complex(kMatrices);
    matrices.resize(n_c * n_c, frf.lines());
    for (Eigen::Index k = 0; k < frf.lines(); ++k)
      matrices.col(k) =
          Eigen::Map<const Eigen::VectorXcd>(values.data() + (first + k) * n_c * n_c, n_c * n_c)
              .conjugate();
    (void)WeightMatrices::user(frf, matrices);
  } catch (const IndefiniteWeights& error) {
    throw indefinite(file, kMatrices, error.what());
  } catch (const std::invalid_argument& error) {
    throw FormatError(file.path(), kMatrices, error.what());
  }
}

}  // namespace

void read_weights(const std::filesystem::path& path, const FrfEstimate& frf, FitOptions& options,
                  WholeLines whole) {
  const Hdf5File file = Hdf5File::open(path);
  if (!file.exists(kMatrices)) {
    Eigen::MatrixXd weights;
    read_diagonals(file, frf, whole, weights);
    options.user_weights = std::move(weights);
    return;
  }
  if (file.exists(kDiagonals))
    throw FormatError(path, kMatrices, "cannot be combined with /weights; keep one of the two");
  read_matrices(file, frf, whole, options.user_weight_matrices);
}

}  // namespace stageid
