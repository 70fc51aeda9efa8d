#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "excitation/multisine/dft.hpp"
#include "frf/runs/channel_choice.hpp"
#include "frf/runs/run_table.hpp"
#include "frf/statistics/matrix_pool.hpp"

namespace stageid {

/// Spectra Z = [Y; U] of one run on the excited lines: DFT / samples, averaged over the clean
/// periods.
struct RunSpectra {
  Eigen::MatrixXcd mean;  ///< (n_y + n_u) x lines
  /// sum_p (Z_p - Z)(Z_p - Z)^H, lower half: a column a line, entry (i, j <= i) at row i (i + 1) /
  /// 2 + j; empty without degrees of freedom.
  Eigen::MatrixXd scatter_re;
  Eigen::MatrixXd scatter_im;
  int scatter_dof = 0;  ///< scatter / scatter_dof / periods estimates Cov(mean)
  /// Degrees of freedom that the scatter of each line has where they differ (poles take some); else empty.
  Eigen::VectorXd line_dof{};
  /// Where the scatter of each line is made of `scatter_window` bins which others use as well: the
  /// first of them, counted among those that are used. 0 and empty: no line shares with another.
  Eigen::Index scatter_window = 0;
  std::vector<Eigen::Index> scatter_first{};
  /// Slope of Z over the periods, of least squares: what Z changes by from one to the next. Empty with one
  /// period, or from a whole record.
  Eigen::MatrixXcd slope{};
  double slope_spread =
      0.0;          ///< sum_p (p - mean p)^2: the slope's variance is that of a period over it
  int periods = 0;  ///< clean ones
  Eigen::VectorXd excluded_power;  ///< sum over the lines of |U|^2 of the excluded actuators
  std::string fingerprint;         ///< of the excitation and of every sample that is not marked
  /// In the order of the periods; which realization and experiment this is, others know.
  std::vector<DroppedPeriod> dropped;
  void drop(int period, std::string reason);
  double dof(Eigen::Index k) const { return line_dof.size() > 0 ? line_dof[k] : scatter_dof; }
};

/// How much two lines' scatters have in common: the squared correlation of their mean squares; 1 for
/// k = l. Of two windows with m of n bins in common, the local polynomials being taken off, it is near
/// x (2 + x) / 3, x = m / n.
double common_scatter(const RunSpectra& run, Eigen::Index k, Eigen::Index l);

/// The lines that spectra are wanted on: the excited ones, ascending, then others.
struct SpectrumLines {
  std::vector<int> lines;
  std::size_t excited = 0;
};

/// What one thread needs again and again: a plan, one period of samples, one period's spectra.
struct RunWorkspace {
  RunWorkspace(int period_samples, MatrixPool& matrices) : dft(period_samples), pool(matrices) {}
  RealDft dft;
  MatrixPool& pool;    // of all threads: scatters leave the workspace with their run
  LogSamples samples;  // the period that is taken
  LogSamples ahead;    // the one behind it: for_each_period()
  LogSamples other;    // of the other kind of channels, where one kind lost samples
  std::vector<Eigen::MatrixXcd> spectra;  // Z_p of some periods, channels x lines
  std::vector<Eigen::MatrixXf> record;    // of the same, less first_samples
  Eigen::MatrixXd first_samples;          // samples x channels
  Eigen::MatrixXd excluded_sum;           // of the periods, samples x excluded actuators
  Eigen::VectorXcd deviation;             // of one period on one line
  Eigen::VectorXd deviation_re;
  Eigen::VectorXd deviation_im;
  Eigen::VectorXd scatter_re;  // of one line
  Eigen::VectorXd scatter_im;
};

class HealthPart;

/// Reads a run period by period and averages. Periods with a marked sample are left out, and with
/// PeriodChoice::consistent those that find_outliers() finds among (about) 16 neighbours.
/// `health`, if there is one, gets each period as well; `read_done` is told the bytes read, period by period.
/// @returns zero periods, and nothing else but which were dropped, if none is clean
/// @throws what LogReader::read() throws.
RunSpectra measure_run(const UsedRun& run, const SpectrumLines& lines,
                       const ChannelChoice& channels, const Eigen::MatrixXd& excitation_period,
                       PeriodChoice choice, RunWorkspace& workspace, HealthPart* health,
                       const std::function<void(double bytes)>& read_done);

}  // namespace stageid
