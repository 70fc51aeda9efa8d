#pragma once

#include <Eigen/Core>
#include <complex>
#include <span>
#include <string>
#include <vector>

#include "acquisition/files/fingerprint.hpp"
#include "frf/runs/excitation_spectrum.hpp"
#include "frf/runs/run_spectra.hpp"

/// What both ways of measuring a run, period by period and as a whole record, have in common.
namespace stageid {

template <typename Matrix>
void add_matrix(Fingerprint& fingerprint, const Matrix& matrix) {
  fingerprint.add(std::as_bytes(std::span(matrix.data(), static_cast<std::size_t>(matrix.size()))));
}

/// One run's excitation: the period as recorded and its spectrum.
struct RunExcitation {
  Eigen::MatrixXd period;
  ExcitationSpectrum spectrum;
};

/// @throws std::invalid_argument if what is recorded is not one period of dft.length() samples
RunExcitation read_run_excitation(const UsedRun& run, RealDft& dft);

/// Unscaled DFT of one column, on lines above zero; valid until the next. @pre samples.rows() == dft.length()
std::span<const std::complex<double>> transform(const Eigen::MatrixXd& samples,
                                                Eigen::Index channel, RealDft& dft);

/// Samples into dft.input(), for lines above zero: of a channel that shows one value throughout these
/// are zeros, where rounding would leave a response of its own. @pre as many as dft.length()
void fill_for_lines(const Eigen::Ref<const Eigen::VectorXd>& samples, RealDft& dft);

/// DFT / samples of one period of the chosen channels, on `lines`, into the rows of `spectra` from
/// `first_row` on.
void line_spectra(const Eigen::MatrixXd& samples, const std::vector<Eigen::Index>& channels,
                  const std::vector<int>& lines, Eigen::Index first_row, RealDft& dft,
                  Eigen::MatrixXcd& spectra);

/// Adds w d d^H to the packed lower half of one line (RunSpectra::scatter_re, scatter_im). In real
/// arithmetic, and without a reduction: the compiler may use any vector width, the bits stay the
/// same.
void add_outer_product(double weight, const Eigen::VectorXd& re, const Eigen::VectorXd& im,
                       double* packed_re, double* packed_im);

/// Power on the lines of the excluded actuators' mean over the periods, from their sum in the
/// workspace: one transform a run, not one a period.
Eigen::VectorXd excluded_power(const std::vector<int>& lines, int periods, RunWorkspace& workspace);

/// Why a run that gave no period is of no use: each is marked.
std::string no_clean_period(const UsedRun& run);

/// @throws FormatError always: each realization has a run without a clean period, the first of them
///         `run`.
[[noreturn]] void refuse_marked_runs(const UsedRun& run);

}  // namespace stageid
