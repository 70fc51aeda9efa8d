#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "estimation/model/fit_record.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

/// How a continuous-time model is compared with sampled data, see docs/theory.md, section 6.
enum class HoldModel : std::uint8_t {
  none,   ///< P(j omega) e^{-j omega delay}
  phase,  ///< and the delay T/2 of the hold
  sinc,   ///< and its magnitude sinc(omega T / 2)
  exact   ///< every basis function through hold, delay and sampler, including aliasing
};
template <>
inline constexpr std::array kWords<HoldModel> = {"none", "phase", "sinc", "exact"};

/// Role of a submodel in a fit; not stored in model files.
enum class SubmodelRole : std::uint8_t {
  searched,   ///< an automatic search may drop it or merge it with another
  given,      ///< requested: it stays, and the data must determine its poles
  suspension  ///< weak stiffness of a rigid body: it stays; below the lines its poles may be held
};

/// What the data say about a mode of a fit.
enum class ModeVerdict : std::uint8_t {
  determined,
  weak,        ///< a standard deviation as large as the value, or not worth its parameters
  at_bound,    ///< the pole ended at a bound, where the lines contain no information on it
  coincident,  ///< another mode is so near that one would fit as well
  beside_band  ///< outside the lines: it represents everything that the plant has there
};
template <>
inline constexpr std::array kWords<ModeVerdict> = {"determined", "weak", "at_bound", "coincident",
                                                   "beside_band"};

/// One pole (real) or one conjugate pair of a submodel.
struct PoleEstimate {
  double natural_frequency_hz = 0.0;  ///< |lambda| / (2 pi)
  double damping_ratio = 1.0;         ///< -Re lambda / |lambda|; 1: real
  std::optional<double> natural_frequency_std_hz = {};
  std::optional<double> damping_ratio_std = {};
};

/// Standard deviations of the mode shapes computed by mode_shapes(), to first order.
struct ModeShapeDeviation {
  Eigen::VectorXcd output_shape;  ///< of the real parts and of the imaginary parts
  Eigen::VectorXcd input_shape;
  double modal_mass = 0.0;
};

/// What a fit does not change of the pole of a mode.
enum class HeldPole : std::uint8_t {
  none,
  frequency,  ///< a_2
  pole,       ///< a_1 and a_2
  guess  ///< both, but what others owe to their value is unknown: the covariance counts them as free
};

/// P_i(s) = (B_0 + B_1 s + ...) / (s^integrators (1 + a_1 s + ...)), s in rad/s.
struct Submodel {
  int integrators = 0;
  std::vector<double> denominator = {1.0};  ///< [1, a_1, ..., a_n]
  std::vector<Eigen::MatrixXd> numerator;   ///< B_0, B_1, ...: n_y x n_u each

  // Filled by a fit where applicable.
  std::optional<double> natural_frequency_std_hz;
  std::optional<double> damping_ratio_std;
  std::optional<ModeShapeDeviation> shape_std = {};
  std::optional<int> residue_rank = {};     ///< rank at which the numerators were held; none: free
  std::optional<ModeVerdict> verdict = {};  ///< of a mode, see judge()
  /// by rising frequency; only for submodels with poles that are not modes
  std::vector<PoleEstimate> poles = {};

  SubmodelRole role = SubmodelRole::searched;
  HeldPole held = HeldPole::none;
  std::vector<Eigen::MatrixXd> numerator_std = {};  ///< per entry of numerator; empty: unknown

  int order() const noexcept { return static_cast<int>(denominator.size()) - 1; }  ///< n
  /// a_1 .. a_n, valid while the denominator is.
  Eigen::Map<const Eigen::VectorXd> coefficients() const {
    return Eigen::Map<const Eigen::VectorXd>(denominator.data() + 1, order());
  }
  /// n = 2 with complex poles: 1/(2 pi sqrt(a_2)) and a_1/(2 sqrt(a_2)).
  bool is_mode() const noexcept { return integrators == 0 && denominator.size() == 3; }
  double natural_frequency_hz() const;  ///< @pre is_mode()
  double damping_ratio() const;         ///< @pre is_mode()
};

/// P(s) = sum of submodels, with delays per channel: the content of model.json.
struct AdditiveModel {
  ChannelList inputs;
  ChannelList outputs;
  double sample_rate_hz = 0.0;  ///< 0: unknown
  HoldModel hold = HoldModel::none;
  Eigen::VectorXd input_delay_s;   ///< n_u
  Eigen::VectorXd output_delay_s;  ///< n_y
  /// Standard deviations of estimated delays, n_u and n_y; empty: given or unknown. Delays per channel are relative to
  /// that of the last output, which is held: its deviation is 0.
  Eigen::VectorXd input_delay_std_s;
  Eigen::VectorXd output_delay_std_s;
  std::vector<Submodel> submodels;
  FitRecord fit;
  std::vector<double> cost_history;
  std::string provenance_json = "{}";

  Eigen::Index n_outputs() const noexcept { return std::ssize(outputs); }
  Eigen::Index n_inputs() const noexcept { return std::ssize(inputs); }
  Eigen::VectorXd input_delays_s() const;   ///< n_u, also if input_delay_s is empty
  Eigen::VectorXd output_delays_s() const;  ///< n_y
  double mean_delay_s() const;              ///< from an input to an output, over the channels
};

/// The response of the model at a list of frequencies, (n_y n_u) x N, column k = vec(P(j omega_k)), through the given
/// hold model and the delays of the model.
/// @throws std::invalid_argument if `hold` needs an unknown sample rate, or a frequency is not below Nyquist.
Eigen::MatrixXcd response(const AdditiveModel& model,
                          const Eigen::Ref<const Eigen::VectorXd>& frequency_hz, HoldModel hold);
/// The same for `count` channels from `first` on.
Eigen::MatrixXcd response(const AdditiveModel& model,
                          const Eigen::Ref<const Eigen::VectorXd>& frequency_hz, HoldModel hold,
                          Eigen::Index first, Eigen::Index count);

/// Writes model.json as in docs/formats.md, atomically.
/// @throws FileError, FormatError
void write_model(const std::filesystem::path& file, const AdditiveModel& model);
AdditiveModel read_model(const std::filesystem::path& file);

}  // namespace stageid
