#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "excitation/words/words.hpp"
#include "frf/response/nonlinearity.hpp"

namespace stageid {

/// Whether the response contains a zero-order hold (and sampler), as measured by a digital loop.
enum class Hold : std::uint8_t { none, zoh };
template <>
inline constexpr std::array kWords<Hold> = {"none", "zoh"};

/// Factor that was divided out of the response: 1; e^{-j omega delay_s}; or the same times the hold's
/// (1 - e^{-j omega T}) / (j omega T).
enum class Compensation : std::uint8_t { none, delay, hold };
template <>
inline constexpr std::array kWords<Compensation> = {"none", "delay", "hold"};

enum class FrfMethod : std::uint8_t {
  periodic,  ///< means over the periods after the transient ones
  lpm        ///< whole records; the transient is modelled, no period is discarded
};
template <>
inline constexpr std::array kWords<FrfMethod> = {"periodic", "lpm"};

/// A recorded period that was excluded from the means.
struct DroppedPeriod {
  int realization = 0;  ///< 0-based, as the other two
  int experiment = 0;
  int period = 0;  ///< index among the periods after the transient ones
  std::string reason;
  friend bool operator==(const DroppedPeriod&, const DroppedPeriod&) = default;
};

/// Samples of a period that were replaced, because they deviate from those of the other periods.
struct ReplacedSamples {
  int realization = 0;  ///< 0-based, as the other two
  int experiment = 0;
  int period = 0;  ///< index among the periods after the transient ones
  int first = 0;   ///< sample of the period, 0-based
  int samples = 0;
  std::string reason;
  friend bool operator==(const ReplacedSamples&, const ReplacedSamples&) = default;
};

/// A realization that was discarded.
struct LeftOutRealization {
  int realization = 0;  ///< 0-based
  std::string reason;
  friend bool operator==(const LeftOutRealization&, const LeftOutRealization&) = default;
};

class Team;

/// Neighbouring lines, channels, inputs or functions.
struct DataRange {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// The largest part of a frequency response: what it has per channel and line.
///
/// Storage is the paper's vec: column k of a channel matrix is vec(G(j omega_k)), channel
/// c = output + outputs * input.
struct ChannelData {
  Eigen::MatrixXcd response;  ///< (n_y n_u) x N, unit of output / unit of input

  /// E|dG|^2 of the given response (the mean), same shape; empty (0 x 0) if unknown.
  Eigen::MatrixXd noise_variance;  ///< from periods: for a repetition with the same phases
  /// From realizations: noise and stochastic nonlinear contributions.
  Eigen::MatrixXd total_variance;

  /// Processes that divide these rows: each has those of own(). Nobody reads or writes the others, so they take no
  /// memory. With one tile of channels, or one process, all rows.
  const Team* team;
  DataRange own() const;
  /// Whether something is true of the rows of any process.
  bool any(bool of_own_rows) const;

  ChannelData();
  ChannelData(const ChannelData& other);  ///< copies only the rows of own()
  ChannelData& operator=(const ChannelData& other) { return *this = ChannelData(other); }
  ChannelData(ChannelData&&) = default;
  ChannelData& operator=(ChannelData&&) = default;
  ~ChannelData() = default;
};

/// A frequency response with its uncertainty: the content of frf.h5.
struct FrfEstimate : ChannelData {
  Eigen::VectorXd frequency_hz;  ///< N, strictly increasing
  ChannelList inputs;            ///< n_u
  ChannelList outputs;           ///< n_y

  double sample_rate_hz = 0.0;  ///< 0: unknown
  Hold hold = Hold::none;
  Compensation compensated = Compensation::none;
  double delay_s = 0.0;  ///< removed by `compensated` (without the hold's own T/2)

  FrfMethod method = FrfMethod::periodic;
  int realizations = 0;
  int periods = 0;  ///< used, of each run
  int experiments = 0;
  double noise_dof = 0.0;  ///< degrees of freedom of noise_variance: M E (P-1), see plant_frf.hpp
  double total_dof = 0.0;  ///< M - 1
  Eigen::VectorXd input_condition;  ///< N: cond(U(k)), ideally 1; empty if unknown
  /// (n_y n_y) x N: C_E, Hermitian, per experiment and the mean of periods; empty if unknown
  Eigen::MatrixXcd residual_covariance;
  /// (n_u n_u) x N: S, Hermitian, with Cov(vec G) = S kron C_E for the mean over realizations; with one
  /// realization S = [(U U^H)^-1]^T. Empty if unknown.
  Eigen::MatrixXcd input_factor;
  /// Largest ratio of the noise powers of two experiments of a realization, see experiment_noise.hpp. If it is not 1,
  /// their covariances were not pooled, and S kron C_E is only an approximation. 1: the experiments agree.
  double experiment_noise_ratio = 1.0;
  /// (n_c n_c) x N on request, n_c = n_y n_u: Cov(vec G); otherwise empty.
  Eigen::MatrixXcd covariance;
  int covariance_lines = 1;  ///< C_E is the mean over this number of lines: smooth_covariance()
  /// Errors on neighbouring lines are correlated: for a smooth model, all N lines have the information of
  /// N / correlated_lines independent ones (zippered experiments; otherwise 1).
  double correlated_lines = 1.0;
  /// N, zippered: residual of the local models over the expected noise; about 1 if the interpolation is accurate and
  /// the plant is linear. Empty if unknown.
  Eigen::VectorXd interpolation_misfit;
  DetectionLines detection;       ///< empty if unknown
  NonlinearityTest nonlinearity;  ///< empty unless there are two periods and two realizations
  std::vector<DroppedPeriod> dropped_periods;
  std::vector<ReplacedSamples> replaced_samples;
  std::vector<LeftOutRealization> left_out_realizations;
  std::vector<std::string> excluded_channels;  ///< actuators outside the sub-plant
  Eigen::VectorXd excluded_power;      ///< their power on excited lines over that of the inputs
  std::string provenance_json = "{}";  ///< inputs (hash), configuration, version, seeds

  Eigen::Index lines() const noexcept { return frequency_hz.size(); }
  /// Number of independent real numbers of the response.
  double independent_numbers() const noexcept {
    return 2.0 * static_cast<double>(response.size()) / correlated_lines;
  }
  Eigen::Index n_outputs() const noexcept { return std::ssize(outputs); }
  Eigen::Index n_inputs() const noexcept { return std::ssize(inputs); }
  Eigen::VectorXd omega_rad_s() const;
  /// G(j omega_k), n_y x n_u; a view, valid as long as *this.
  Eigen::Map<const Eigen::MatrixXcd> at(Eigen::Index k) const;
};

/// The lines with low_hz <= f <= high_hz; an estimate that is moved in is not copied.
/// @throws std::invalid_argument if none is left.
FrfEstimate select_band(FrfEstimate frf, double low_hz, double high_hz);

/// C_E of line k, n_y x n_y. @pre the residual covariance is known
Eigen::MatrixXcd output_covariance(const FrfEstimate& frf, Eigen::Index k);

/// The named channels, in the given order; an estimate that is moved in and has them so is not copied. @throws std::invalid_argument naming an unknown channel and the existing
/// ones.
FrfEstimate select_channels(FrfEstimate frf, const std::vector<std::string>& inputs,
                            const std::vector<std::string>& outputs);

/// Checks that shapes agree, frequencies increase, numbers are finite and variances are not negative.
/// @throws std::invalid_argument "response[line 12, z1 <- a3]: not finite".
void check(const FrfEstimate& frf);

}  // namespace stageid
