#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "acquisition/files/fingerprint.hpp"
#include "frf/runs/excitation_spectrum.hpp"
#include "frf/runs/run_spectra.hpp"

/// Steps common to both ways of measuring a run: by periods and as a whole record.
namespace stageid {

template <typename Matrix>
void add_matrix(Fingerprint& fingerprint, const Matrix& matrix) {
  fingerprint.add(std::as_bytes(std::span(matrix.data(), static_cast<std::size_t>(matrix.size()))));
}

/// One run's excitation: the recorded period and its spectrum.
struct RunExcitation {
  Eigen::MatrixXd period;
  ExcitationSpectrum spectrum;
};

/// @throws std::invalid_argument if the excitation is not one period of dft.length() samples
RunExcitation read_run_excitation(const UsedRun& run, RealDft& dft);

/// The excitation channels that any of the runs excites, ascending.
std::vector<Eigen::Index> excited_axes(const std::vector<RunExcitation>& runs);

/// Frequencies of lines, which may be none. @pre ascending
Eigen::VectorXd frequencies_hz(const LogInfo& info, const std::vector<int>& lines);

/// Threads that each have a workspace, at most one per run of a log, because each contains a period of samples.
class RunWorkers {
 public:
  RunWorkers(int threads, std::size_t runs, int period_samples);
  MatrixPool& pool() noexcept { return pool_; }
  /// Calls work(workspace, i) for i = 0 .. count - 1 as for_each_task() does.
  void for_each(std::size_t count,
                const std::function<void(RunWorkspace& workspace, std::size_t i)>& work);
  /// @param keep_periods false saves memory: the samples of all runs are large
  /// @throws the same as read_run_excitation()
  std::vector<RunExcitation> read_excitation(const std::vector<UsedRun>& runs, bool keep_periods);

 private:
  MatrixPool pool_;
  std::vector<std::unique_ptr<RunWorkspace>> workspaces_;
};

/// DFT / number of samples of the selected channels, on `lines`, into the rows of `spectra` from `first_row` on. A
/// constant channel gives zeros, also on line zero; otherwise, rounding would cause a response.
/// @pre samples.rows() == dft.length()
void line_spectra(const Eigen::Ref<const Eigen::MatrixXd>& samples,
                  const std::vector<Eigen::Index>& channels, const std::vector<int>& lines,
                  Eigen::Index first_row, RealDft& dft, Eigen::MatrixXcd& spectra);

/// Adds w d d^H to the packed lower half of one line (RunSpectra::scatter_re, scatter_im). In real arithmetic and
/// without a reduction, so that the bits do not depend on the compiler's vector width.
void add_outer_product(double weight, const Eigen::VectorXd& re, const Eigen::VectorXd& im,
                       double* packed_re, double* packed_im);

/// Power on the lines of the excluded actuators' mean over the periods, from their sum in the workspace: one transform
/// per run instead of one per period.
Eigen::VectorXd excluded_power(const std::vector<int>& lines, int periods, RunWorkspace& workspace);

/// Reason for discarding a run without periods: all are marked.
std::string no_clean_period(const UsedRun& run);

/// @throws FormatError always: each realization has a run without a clean period; `run` is the first of them.
[[noreturn]] void refuse_marked_runs(const UsedRun& run);

}  // namespace stageid
