#include "estimation/problem/fit_start.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "excitation/words/require.hpp"
#include "frf/response/dc_line.hpp"

namespace stageid {
namespace {

void check_structure(const FrfEstimate& frf, const AdditiveModel& start) {
  int biproper = 0;
  int integrating = 0;
  for (const Submodel& s : start.submodels) {
    const auto [l, n, m] = shape_of(s);
    require(n >= 0 && s.denominator[0] == 1.0, "fit: a denominator must start with 1");
    require(l >= 0 && l <= 2, "fit: a submodel must have 0, 1 or 2 integrators");
    require(std::ranges::all_of(s.denominator, [](double a) { return std::isfinite(a); }) &&
                s.denominator.back() != 0.0,
            "fit: a denominator must be finite and not end with 0");
    require(m >= 0 && m <= n + l, "fit: a submodel must be proper and have a numerator");
    biproper += m == n + l ? 1 : 0;
    integrating += l > 0 ? 1 : 0;
    for (const Eigen::MatrixXd& B : s.numerator)
      require(B.rows() == frf.n_outputs() && B.cols() == frf.n_inputs(),
              "fit: the shape of a numerator must be outputs x inputs");
  }
  require(biproper <= 1,
          "fit: at most one submodel may be biproper; otherwise the model is not unique");
  require(integrating <= 1,
          "fit: at most one submodel may have integrators; otherwise the model is not unique");
}

/// The coefficients of the poles that are held.
std::vector<Eigen::Index> held_coefficients(const AdditiveModel& start) {
  std::vector<Eigen::Index> out;
  Eigen::Index first = 0;
  for (const Submodel& s : start.submodels) {
    const HeldPole held = s.is_mode() ? s.held : HeldPole::none;
    if (held == HeldPole::pole || held == HeldPole::guess) out.push_back(first);
    if (held != HeldPole::none) out.push_back(first + 1);
    first += s.order();
  }
  return out;
}

}  // namespace

void check_start(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options) {
  check(frf);
  require(!start.submodels.empty(),
          "fit: the start has no submodel; give at least one mode or the rigid body");
  require(options.max_iterations >= 0, "fit: max_iterations must be 0 or more");
  require(std::isfinite(options.delay_s), "fit: the delay must be finite");
  require(!has_dc_line(frf), "fit: a line is at 0 Hz; remove it (without_dc_line)");
  if (options.hold != HoldModel::none)
    require(frf.sample_rate_hz > 0.0,
            "fit: hold {} needs a sample rate, but the FRF has none; use hold none",
            to_string(options.hold));
  if (options.hold == HoldModel::exact)
    require(frf.frequency_hz.maxCoeff() < 0.5 * frf.sample_rate_hz,
            "fit: a line is at or above half the sample rate; choose a smaller band");
  const bool matrices =
      options.weighting == Weighting::likelihood ||
      (options.weighting == Weighting::user && options.user_weight_matrices.size() > 0);
  require(
      !matrices || (options.residue_rank == 0 && options.rigid_body_rank == 0),
      "fit: residues of given rank need one weight per channel; use --weighting noise_variance");
  require(!matrices || options.method != FitMethod::sk,
          "fit: method sk supports only diagonal weights; use riv or gn");
  check_structure(frf, start);
}

FitProblem make_problem(const FrfEstimate& frf, const AdditiveModel& start,
                        const FitOptions& options, SharedMatrix<Eigen::MatrixXd> W) {
  FitProblem problem;
  problem.lines = {frf.omega_rad_s(), frf.sample_rate_hz > 0.0 ? 1.0 / frf.sample_rate_hz : 0.0,
                   options.hold};
  problem.n_outputs = frf.n_outputs();
  problem.n_inputs = frf.n_inputs();
  problem.G = SharedMatrix<Eigen::MatrixXcd>::kept(frf.response);
  problem.W = std::move(W);
  for (const Submodel& s : start.submodels) {
    problem.shapes.push_back(shape_of(s));
    problem.roles.push_back(s.role);
  }
  problem.held = held_coefficients(start);
  problem.delay = options.delay;
  problem.limit = options.limit;
  problem.threads = worker_count(options.threads);
  if (options.team != nullptr) problem.team = options.team;
  const Eigen::Index per_channel = problem.functions();
  require(
      2 * problem.size() >= per_channel && 2 * problem.size() * problem.channels() >=
                                               problem.globals() + per_channel * problem.channels(),
      "fit: {} of {} are too few for {} parameters; choose fewer modes or a wider band",
      counted(problem.size(), "line"), counted(problem.channels(), "channel"),
      problem.globals() + per_channel * problem.channels());
  return problem;
}

FitParameters make_parameters(const FitProblem& problem, const AdditiveModel& start,
                              const FitOptions& options) {
  FitParameters beta;
  for (const Submodel& s : start.submodels) beta.a.emplace_back(s.coefficients());
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

void drop_guesses(const AdditiveModel& model, std::vector<Eigen::Index>& globals) {
  Eigen::Index first = 0;
  for (const Submodel& s : model.submodels) {
    const Eigen::Index next = first + s.order();
    if (s.held == HeldPole::guess)
      std::erase_if(globals, [&](Eigen::Index p) { return p >= first && p < next; });
    first = next;
  }
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

}  // namespace stageid
