#include "estimation/fit_additive_model.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "estimation/fit_iteration.hpp"
#include "estimation/low_rank_iteration.hpp"
#include "estimation/numerators.hpp"
#include "estimation/parameter_covariance.hpp"
#include "estimation/weight_matrices.hpp"

namespace stageid {
namespace {

void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}

void check_start(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options) {
  check(frf);
  require(!start.submodels.empty(),
          "fit: the start has no submodel; give at least one mode or the rigid body");
  require(options.max_iterations >= 0, "fit: max_iterations must not be negative");
  require(std::isfinite(options.delay_s), "fit: the delay must be finite");
  if (options.hold != HoldModel::none)
    require(frf.sample_rate_hz > 0.0,
            fmt::format("fit: hold {} needs the sample rate, and the FRF has none; use hold none",
                        to_string(options.hold)));
  if (options.hold == HoldModel::exact)
    require(frf.frequency_hz.maxCoeff() < 0.5 * frf.sample_rate_hz,
            "fit: a line lies at or above half the sample rate; choose a smaller band");
  const bool matrices =
      options.weighting == Weighting::likelihood ||
      (options.weighting == Weighting::user && options.user_weight_matrices.size() > 0);
  require(!matrices || (options.residue_rank == 0 && options.rigid_body_rank == 0),
          "fit: residues of given rank are fitted with one weight a channel; use --weighting "
          "noise_variance");
  require(!matrices || options.method != FitMethod::sk,
          "fit: method sk takes diagonal weights only; use riv or gn");
  int biproper = 0;
  int integrating = 0;
  for (const Submodel& s : start.submodels) {
    const auto n = static_cast<int>(s.denominator.size()) - 1;
    const auto m = static_cast<int>(s.numerator.size()) - 1;
    require(n >= 0 && s.denominator[0] == 1.0, "fit: a denominator must start with 1");
    require(s.integrators >= 0 && s.integrators <= 2,
            "fit: a submodel may have 0, 1 or 2 integrators");
    require(m >= 0 && m <= n + s.integrators,
            "fit: a submodel must be proper and have a numerator");
    biproper += m == n + s.integrators ? 1 : 0;
    integrating += s.integrators > 0 ? 1 : 0;
    for (const Eigen::MatrixXd& B : s.numerator)
      require(B.rows() == frf.n_outputs() && B.cols() == frf.n_inputs(),
              "fit: a numerator's shape is not outputs x inputs");
  }
  require(biproper <= 1, "fit: at most one submodel may be biproper, or the model is not unique");
  require(integrating <= 1,
          "fit: at most one submodel may have integrators, or the model is not unique");
}

FitProblem make_problem(const FrfEstimate& frf, const AdditiveModel& start,
                        const FitOptions& options, Eigen::MatrixXd W) {
  FitProblem problem;
  problem.lines = {frf.omega_rad_s(), frf.sample_rate_hz > 0.0 ? 1.0 / frf.sample_rate_hz : 0.0,
                   options.hold};
  problem.n_outputs = frf.n_outputs();
  problem.n_inputs = frf.n_inputs();
  problem.G_re = frf.response.real();
  problem.G_im = frf.response.imag();
  problem.W = std::move(W);
  for (const Submodel& s : start.submodels)
    problem.shapes.push_back({s.integrators, static_cast<int>(s.denominator.size()) - 1,
                              static_cast<int>(s.numerator.size()) - 1});
  problem.delay = options.delay;
  const auto cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  problem.threads = options.threads > 0 ? options.threads : cores;
  const Eigen::Index per_channel = problem.functions();
  require(
      2 * problem.size() >= per_channel && 2 * problem.size() * problem.channels() >=
                                               problem.globals() + per_channel * problem.channels(),
      fmt::format("fit: {} lines of {} channels cannot carry {} parameters; choose fewer modes or "
                  "a wider band",
                  problem.size(), problem.channels(),
                  problem.globals() + per_channel * problem.channels()));
  return problem;
}

FitParameters make_parameters(const FitProblem& problem, const AdditiveModel& start,
                              const FitOptions& options) {
  FitParameters beta;
  for (const Submodel& s : start.submodels)
    beta.a.push_back(Eigen::Map<const Eigen::VectorXd>(
        s.denominator.data() + 1, static_cast<Eigen::Index>(s.denominator.size()) - 1));
  const bool from_start = options.delay != DelayModel::fixed &&
                          start.input_delay_s.size() == problem.n_inputs &&
                          start.output_delay_s.size() == problem.n_outputs;
  beta.input_delay_s = from_start ? start.input_delay_s
                                  : Eigen::VectorXd::Constant(problem.n_inputs, options.delay_s);
  beta.output_delay_s =
      from_start ? start.output_delay_s : Eigen::VectorXd::Zero(problem.n_outputs);
  beta.B.setZero(problem.channels(), problem.functions());
  Eigen::Index f = 0;
  for (const Submodel& s : start.submodels)
    for (const Eigen::MatrixXd& B : s.numerator) beta.B.col(f++) = B.reshaped();
  return beta;
}

void fill_submodels(const FitProblem& problem, const FitParameters& beta, AdditiveModel& model) {
  Eigen::Index f = 0;
  for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
    Submodel& s = model.submodels[i];
    s.denominator.assign(1, 1.0);
    s.denominator.insert(s.denominator.end(), beta.a[i].begin(), beta.a[i].end());
    for (Eigen::MatrixXd& B : s.numerator)
      B = beta.B.col(f++).reshaped(problem.n_outputs, problem.n_inputs);
  }
  model.input_delay_s = beta.input_delay_s;
  model.output_delay_s = beta.output_delay_s;
}

/// True if the weights claim to be the inverse of the noise's covariance.
bool weighs_by_variance(Weighting weighting) {
  return weighting == Weighting::noise_variance || weighting == Weighting::total_variance ||
         weighting == Weighting::likelihood;
}

/// Delta method, facts.md section 10:  df = -f/2 da_2/a_2,  dzeta = zeta (da_1/a_1 - da_2/(2 a_2)).
void fill_deviations(const ParameterCovariance& covariance, AdditiveModel& model) {
  Eigen::Index first = 0;
  Eigen::Index f = 0;
  for (Submodel& s : model.submodels) {
    const auto order = static_cast<Eigen::Index>(s.denominator.size()) - 1;
    if (s.is_mode()) {
      const Eigen::Matrix2d C = covariance.globals.block<2, 2>(first, first);
      const double a1 = s.denominator[1];
      const double a2 = s.denominator[2];
      const Eigen::Vector2d df(0.0, -0.5 * s.natural_frequency_hz() / a2);
      const Eigen::Vector2d dz = s.damping_ratio() * Eigen::Vector2d(1.0 / a1, -0.5 / a2);
      // Zero: the mode stands at a bound and its place, or its damping, is not in the data.
      if (C(1, 1) > 0.0) s.natural_frequency_std_hz = std::sqrt(std::max(0.0, df.dot(C * df)));
      if (C(1, 1) > 0.0 && C(0, 0) > 0.0)
        s.damping_ratio_std = std::sqrt(std::max(0.0, dz.dot(C * dz)));
    }
    first += order;
    for (const Eigen::MatrixXd& B : s.numerator)
      s.numerator_std.emplace_back(
          covariance.numerator_variance.col(f++).cwiseMax(0.0).cwiseSqrt().reshaped(B.rows(),
                                                                                    B.cols()));
  }
}

void use_covariance(const ParameterCovariance& covariance, bool likelihood, FitResult& result) {
  if (covariance.response_variance.size() == 0) return;
  if (!covariance.globals.allFinite() || !covariance.numerator_variance.allFinite() ||
      !covariance.response_variance.allFinite()) {
    result.decisions.emplace_back(
        "no standard deviations: the covariance of the parameters is not finite; some of them are "
        "not in the data");
    return;
  }
  fill_deviations(covariance, result.model);
  result.response_variance = covariance.response_variance;
  if (likelihood && covariance.residual_scale > 1.0)
    result.decisions.push_back(
        fmt::format("the residual is {:.3g} times what the variances predict: the model does not "
                    "explain the data; standard deviations are raised by {:.3g}",
                    covariance.residual_scale, std::sqrt(covariance.residual_scale)));
}

/// What is known of the noise under diagonal weights. The given variance is taken as it is: the
/// covariance is linear in it, and smoothing would only lower its peaks. Nonlinear distortion moves
/// an estimate from realization to realization as noise does: the total variance counts where there
/// is one.
DataNoise data_noise(const FrfEstimate& frf, const FitOptions& options) {
  const Eigen::MatrixXd& known =
      frf.total_variance.size() > 0 ? frf.total_variance : frf.noise_variance;
  DataNoise noise;
  if (weighs_by_variance(options.weighting)) {
    noise.knowledge = VarianceKnowledge::weights;
    noise.variance = weighed_variance(frf, options.weighting);
  } else if (known.size() > 0 && known.minCoeff() > 0.0) {
    noise.knowledge = VarianceKnowledge::given;
    noise.variance = known;
  }
  if (noise.knowledge != VarianceKnowledge::none) noise.correlation = output_correlation(frf);
  return noise;
}

void fill_uncertainty(const FrfEstimate& frf, const FitOptions& options, const FitProblem& problem,
                      const std::optional<WeightMatrices>& matrices, const FitParameters& beta,
                      const IterationResult& iteration, FitResult& result) {
  const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, true);
  const Residual& E = iteration.E;
  const bool likelihood = weighs_by_variance(options.weighting);
  use_covariance(
      matrices ? joint_covariance(problem, beta, groups, E,
                                  JointEquations(problem, *matrices, beta, groups, E),
                                  likelihood ? VarianceKnowledge::weights : VarianceKnowledge::none,
                                  matrices->scatter_factor(), iteration.frozen)
               : parameter_covariance(problem, beta, groups, E,
                                      ArrowSystem(problem, beta, groups, E, FitMethod::gn),
                                      data_noise(frf, options), iteration.frozen),
      likelihood, result);
}

/// What giving up the free residues cost, and whether noise alone would have.
std::string rank_decision(const FitProblem& problem, const IterationResult& free,
                          const LowRankResult& constrained, bool likelihood) {
  std::string text = fmt::format("residues of the given ranks: cost {:.6g} -> {:.6g}", free.E.cost,
                                 constrained.iteration.E.cost);
  if (!likelihood) return text;
  // Twice the rise of sum W |E|^2 is chi-square distributed where the ranks are right.
  const double rise =
      4.0 * static_cast<double>(problem.size()) * (constrained.iteration.E.cost - free.E.cost);
  const auto given_up = static_cast<double>(problem.parameters() - constrained.parameters);
  const double sigmas = (rise - given_up) / std::sqrt(2.0 * std::max(given_up, 1.0));
  return text + fmt::format(", chi-square {:.4g} for {:.0f} parameters given up: {}", rise,
                            given_up,
                            sigmas < 3.0 ? "what noise explains"
                                         : "more than noise explains, the ranks are too low or the "
                                           "variances too small");
}

double relative_rms_error(const FrfEstimate& frf, const Residual& E) {
  double sum = 0.0;
  Eigen::Index count = 0;
  for (Eigen::Index k = 0; k < E.re.cols(); ++k)
    for (Eigen::Index c = 0; c < E.re.rows(); ++c) {
      const double power = std::norm(frf.response(c, k));
      if (!(power > 0.0)) continue;
      sum += (E.re(c, k) * E.re(c, k) + E.im(c, k) * E.im(c, k)) / power;
      ++count;
    }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
}

}  // namespace

FitResult fit_additive_model(const FrfEstimate& frf, const AdditiveModel& start,
                             const FitOptions& options) {
  check_start(frf, start, options);
  const std::optional<WeightMatrices> matrices = make_weight_matrices(frf, options);
  const FitProblem problem = make_problem(
      frf, start, options, matrices ? matrices->marginal() : make_weights(frf, options));
  FitParameters beta = make_parameters(problem, start, options);
  if (options.delay != DelayModel::fixed && options.delay_s == 0.0 &&
      start.input_delay_s.size() == 0)
    search_delay(problem, beta);

  FitResult result;
  result.model = start;
  IterationResult iteration = iterate(problem, beta, options);
  if (matrices && iteration.status != FitStatus::singular) {
    result.decisions.push_back(
        fmt::format("weight matrices: started from their best diagonal, {} "
                    "iterations ({})",
                    iteration.iterations, to_string(iteration.status)));
    iteration = iterate(problem, *matrices, beta, options);
  }
  const bool low_rank = options.residue_rank > 0 || options.rigid_body_rank > 0;
  ParameterCovariance covariance;
  std::vector<int> ranks;
  if (low_rank && iteration.status != FitStatus::singular) {
    LowRankResult constrained = iterate_low_rank(problem, beta, options, data_noise(frf, options));
    result.decisions.push_back(
        rank_decision(problem, iteration, constrained, weighs_by_variance(options.weighting)));
    constrained.iteration.cost.insert(constrained.iteration.cost.begin(), iteration.cost.begin(),
                                      iteration.cost.end());
    constrained.iteration.iterations += iteration.iterations;
    iteration = std::move(constrained.iteration);
    covariance = std::move(constrained.covariance);
    ranks = std::move(constrained.ranks);
  }
  for (std::size_t i = 0; i < result.model.submodels.size(); ++i) {
    Submodel& s = result.model.submodels[i];
    s.natural_frequency_std_hz.reset();  // the start's
    s.damping_ratio_std.reset();
    s.numerator_std.clear();
    s.residue_rank = i < ranks.size() && ranks[i] > 0 ? std::optional(ranks[i]) : std::nullopt;
  }
  result.status = iteration.status;
  result.message = iteration.message;
  result.cost = iteration.cost;
  result.model.inputs = frf.inputs;
  result.model.outputs = frf.outputs;
  result.model.sample_rate_hz = frf.sample_rate_hz;
  result.model.hold = options.hold;
  fill_submodels(problem, beta, result.model);
  result.removal_cost = removal_costs(problem, evaluate_groups(problem, beta, false), beta.B);
  if (low_rank)
    use_covariance(covariance, weighs_by_variance(options.weighting), result);
  else if (options.uncertainty && result.status != FitStatus::singular)
    fill_uncertainty(frf, options, problem, matrices, beta, iteration, result);

  FitRecord& record = result.model.fit;
  record.cost = iteration.E.cost;
  record.weighting = to_string(options.weighting);
  record.iterations = iteration.iterations;
  record.status = to_string(result.status);
  record.relative_rms_error = relative_rms_error(frf, iteration.E);
  record.band_hz[0] = frf.frequency_hz[0];
  record.band_hz[1] = frf.frequency_hz[frf.lines() - 1];
  result.model.cost_history = result.cost;
  return result;
}

}  // namespace stageid
