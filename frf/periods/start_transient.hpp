#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// Transient of the start of a run in the used periods, line by line. Z_0 is the last discarded period, or the
/// first used one if none was discarded; Z_1 ... Z_P are the following ones:
///   B = Z_0 - mean(Z_1 ... Z_P),  W = Z_1 - mean(Z_2 ... Z_P).
/// A ringing mode adds A q^p to Z_p, q = e^{pole x period}, so W is B times one complex number in all runs.
/// For noise the phase is random. The sensors are summed, each over its noise.
///
/// A drift adds D p to Z_p. W and V = Z_{P-1} - Z_P are then multiples of D, and B, if no start rings beside it.
struct RunStart {
  Eigen::VectorXcd along;   ///< sum over the sensors of conj(B) W, per line
  Eigen::VectorXcd ending;  ///< the same of conj(B) V
  Eigen::VectorXd start;    ///< |B|^2
  Eigen::VectorXd first;    ///< |Z_1 - mean(Z_2 ... Z_{P-1})|^2
  Eigen::VectorXd last;     ///< |Z_P - mean(Z_2 ... Z_{P-1})|^2
  Eigen::VectorXd noise;    ///< of one period: |Z_P - Z_{P-1}|^2 / 2
  int periods = 0;          ///< P
  bool start_used = false;  ///< whether Z_0 is one of the used periods
};

/// The runs of a log with evidence about their start.
struct StartEvidence {
  Eigen::VectorXd frequency_hz;  ///< of the lines; empty: unknown
  std::vector<RunStart> runs;
  Eigen::Index sensors = 0;
  int transient_periods = 0;  ///< discarded
  int periods = 0;            ///< used, per run
};

/// Gathers RunStart from the spectra of consecutive periods.
class StartRecorder {
 public:
  StartRecorder() = default;
  /// @param start Z_0, sensors x lines; empty if no period was discarded
  explicit StartRecorder(Eigen::MatrixXcd start);

  void take(const Eigen::Ref<const Eigen::MatrixXcd>& spectra);
  /// Call this if a period is missing: the run gives no evidence then.
  void give_up() noexcept { on_ = false; }
  bool on() const noexcept { return on_; }
  /// `periods` is 0 if there is no evidence.
  RunStart finish();

 private:
  bool on_ = false;
  bool start_used_ = false;
  int count_ = 0;
  Eigen::MatrixXcd start_;
  Eigen::MatrixXcd first_;
  Eigen::MatrixXcd latest_;
  Eigen::MatrixXcd before_latest_;
  Eigen::MatrixXcd rest_mean_;  // of Z_2 ...
};

}  // namespace stageid
