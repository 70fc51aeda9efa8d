#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "excitation/multisine/dft.hpp"
#include "excitation/threads/parcel.hpp"
#include "frf/runs/channel_choice.hpp"
#include "frf/runs/run_table.hpp"
#include "frf/statistics/matrix_pool.hpp"

namespace stageid {

/// Spectra Z = [Y; U] of one run on the excited lines: DFT / number of samples, averaged over the used periods.
struct RunSpectra {
  Eigen::MatrixXcd mean;  ///< (n_y + n_u) x lines
  /// sum_p (Z_p - Z)(Z_p - Z)^H, lower half: one column per line, entry (i, j <= i) at row i (i + 1) / 2 + j. Empty
  /// without degrees of freedom.
  Eigen::MatrixXd scatter_re;
  Eigen::MatrixXd scatter_im;
  int scatter_dof = 0;  ///< scatter / scatter_dof / periods estimates Cov(mean)
  /// Degrees of freedom of each line's scatter if they differ (each pole uses some); otherwise empty.
  Eigen::VectorXd line_dof{};
  /// If lines share bins, the scatter of each line depends on `scatter_window` bins. scatter_first is the index of the
  /// first, counted among the used bins. Otherwise 0 and empty.
  Eigen::Index scatter_window = 0;
  std::vector<Eigen::Index> scatter_first{};
  /// Slope of Z over the periods by least squares: its change per period. Empty with one period or from a whole
  /// record.
  Eigen::MatrixXcd slope{};
  /// sum_p (p - mean p)^2: the slope's variance is that of a period divided by it.
  double slope_spread = 0.0;
  /// How far the excited lines of an output have their noise in common, by output and noise_block(). With f the share of
  /// a period in the scatter of a line, minus 1/P: sum_p (sum_k f)^2 over sum_p sum_k f^2 is 1 for independent lines, and
  /// their number if slow noise leaks into all of them. Empty from a whole record.
  Eigen::MatrixXd common_sum{};
  Eigen::MatrixXd own_sum{};
  int periods = 0;                 ///< number of those used
  Eigen::VectorXd excluded_power;  ///< sum over the lines of |U|^2 of the excluded actuators
  std::string fingerprint;         ///< of the excitation and of every unmarked sample
  /// In order of the periods.
  std::vector<DroppedPeriod> dropped;
  std::vector<ReplacedSamples> replaced;
  /// Periods that differ from the others by more than noise: dropped, or with replaced samples.
  std::vector<int> deviating;
  void drop(const LogRun& of, int period, std::string reason);
  double dof(Eigen::Index k) const { return line_dof.size() > 0 ? line_dof[k] : scatter_dof; }
  /// The scatter of line k as a full matrix. @pre degrees of freedom
  Eigen::MatrixXcd scatter(Eigen::Index k) const;
};

/// Packs or unpacks all of it.
void carry(Parcel& parcel, RunSpectra& run);

/// Common part of two lines' scatters: the squared correlation of their mean squares; 1 for k = l. For two windows with
/// m of n bins in common, without the local polynomials, it is approximately x (2 + x) / 3, x = m / n.
double common_scatter(const RunSpectra& run, Eigen::Index k, Eigen::Index l);

/// Blocks of at least 64 lines, at most 16, in which the noise of experiments is compared.
Eigen::Index noise_blocks(Eigen::Index lines);
/// The block of line k.
Eigen::Index noise_block(Eigen::Index k, Eigen::Index lines);

/// The lines of the spectra: the excited ones, ascending, then others.
struct SpectrumLines {
  std::vector<int> lines;
  std::size_t excited = 0;
  std::vector<int> excited_lines() const {
    return {lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(excited)};
  }
};

/// Reusable memory of one thread: a plan, one period of samples, one period's spectra.
struct RunWorkspace {
  RunWorkspace(int period_samples, MatrixPool& matrices) : dft(period_samples), pool(matrices) {}
  RealDft dft;
  MatrixPool& pool;                       // of all threads: scatters are kept with their run
  LogSamples samples;                     // the current period
  LogSamples ahead;                       // the next one: for_each_period()
  LogSamples other;                       // of the other kind of channels, if one kind lost samples
  std::vector<Eigen::MatrixXcd> spectra;  // Z_p of some periods, channels x lines
  std::vector<Eigen::MatrixXf> record;    // of the same, minus first_samples
  Eigen::MatrixXd first_samples;          // samples x channels
  Eigen::MatrixXd excluded_sum;           // over the periods, samples x excluded actuators
  Eigen::VectorXcd deviation;             // of one period on one line
  Eigen::VectorXd deviation_re;
  Eigen::VectorXd deviation_im;
  Eigen::VectorXd scatter_re;  // of one line
  Eigen::VectorXd scatter_im;
};

class HealthPart;

/// Receives the bytes read, period by period.
using ReadDone = std::function<void(double bytes)>;

/// Reads a run period by period and averages. Periods with a marked sample are discarded, and with
/// PeriodChoice::consistent those that find_outliers() finds among about 16 neighbours. If at most a tenth of such a
/// period deviates, only these samples are replaced (bridge_samples()), and the period is used.
/// `health`, if not null, receives each period as well.
/// @returns zero periods and only the dropped ones if none is clean
/// @throws the same as LogReader::read().
RunSpectra measure_run(const UsedRun& run, const SpectrumLines& lines,
                       const ChannelChoice& channels, const Eigen::MatrixXd& excitation_period,
                       PeriodChoice choice, RunWorkspace& workspace, HealthPart* health,
                       const ReadDone& read_done);

}  // namespace stageid
