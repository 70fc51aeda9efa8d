#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// How much of the start of a run is left in the periods that are used, line by line. Z_0 is the period
/// before the used ones, or the first of them if none was passed over; Z_1 ... Z_P are those after it:
///   B = Z_0 - mean(Z_1 ... Z_P),  W = Z_1 - mean(Z_2 ... Z_P),  V = Z_P - mean(Z_1 ... Z_{P-1}).
/// A mode that rings adds A q^p to Z_p, q = e^{pole x period}, so that W is a multiple of B by one complex
/// number in all runs; noise has any phase. Sensors are summed up, each over its noise.
struct RunStart {
  Eigen::VectorXcd along;  ///< lines: sum over the sensors of conj(B) W
  Eigen::VectorXd start;   ///< |B|^2
  Eigen::VectorXd first;   ///< |W|^2 (P - 1) / P: the noise of one period if nothing rings
  Eigen::VectorXd last;    ///< |V|^2 (P - 1) / P
  Eigen::VectorXd noise;   ///< of one period, from Z_2 ... Z_P; P = 2: from both
  double noise_dof = 0.0;
  int periods = 0;          ///< P
  bool start_used = false;  ///< Z_0 is one of the used periods
};

/// The runs of a log that can be told from.
struct StartEvidence {
  Eigen::VectorXd frequency_hz;  ///< of the lines; empty: nothing is known
  std::vector<RunStart> runs;
  Eigen::Index sensors = 0;
  int transient_periods = 0;  ///< passed over
  int periods = 0;            ///< used, of a run
};

/// Gathers RunStart from the spectra of consecutive periods.
class StartRecorder {
 public:
  StartRecorder() = default;
  /// @param start Z_0, sensors x lines; empty if no period was passed over
  explicit StartRecorder(Eigen::MatrixXcd start);

  void take(const Eigen::Ref<const Eigen::MatrixXcd>& spectra);
  /// A period is missing: nothing can be told of this run.
  void give_up() noexcept { on_ = false; }
  bool on() const noexcept { return on_; }
  /// Periods are 0 if nothing can be told.
  RunStart finish();

 private:
  bool on_ = false;
  bool start_used_ = false;
  int count_ = 0;
  Eigen::MatrixXcd start_;
  Eigen::MatrixXcd first_;
  Eigen::MatrixXcd latest_;
  Eigen::MatrixXcd rest_mean_;  // of Z_2 ...
  Eigen::MatrixXd rest_scatter_;
};

}  // namespace stageid
