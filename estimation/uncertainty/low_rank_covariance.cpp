#include "estimation/uncertainty/low_rank_covariance.hpp"

#include <algorithm>

#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

/// The free parameters that some channels depend on, in order.
std::vector<Eigen::Index> parameters_of(const FitProblem& problem, const FitParameters& beta,
                                        const ResidueFactors& factors, Eigen::Index first_channel,
                                        Eigen::Index channels) {
  std::vector<Eigen::Index> own;
  for (Eigen::Index p = 0; p < problem.globals(); ++p) own.push_back(p);
  std::vector<ResidueFactors::Entry> entries;
  for (Eigen::Index c = first_channel; c < first_channel + channels; ++c) {
    factors.channel_entries(beta, c, entries);
    for (const ResidueFactors::Entry& t : entries) own.push_back(t.parameter);
  }
  std::sort(own.begin(), own.end());
  own.erase(std::unique(own.begin(), own.end()), own.end());
  return own;
}

/// Columns d vec(P)_c / d own parameters, lines x own each.
void free_columns(const FitProblem& problem, const FitParameters& beta,
                  const ResidueFactors& factors, const BasisGroup& group, Eigen::Index c,
                  const std::vector<Eigen::Index>& own, LineRange lines, Eigen::MatrixXd& re,
                  Eigen::MatrixXd& im) {
  global_columns(problem, beta, group, c, derivative_columns(problem), lines, re, im);
  const auto n = static_cast<Eigen::Index>(own.size());
  re.conservativeResizeLike(Eigen::MatrixXd::Zero(lines.count, n));
  im.conservativeResizeLike(Eigen::MatrixXd::Zero(lines.count, n));
  std::vector<ResidueFactors::Entry> entries;
  factors.channel_entries(beta, c, entries);
  for (const auto& [function, parameter, value] : entries) {
    const auto at = std::lower_bound(own.begin(), own.end(), parameter) - own.begin();
    re.col(at) += value * group.F_re.col(function).segment(lines.first, lines.count);
    im.col(at) += value * group.F_im.col(function).segment(lines.first, lines.count);
  }
}

/// T^T K T with correlated channels.
Eigen::MatrixXd correlated_middle(const FitProblem& problem, const FitParameters& beta,
                                  const std::vector<BasisGroup>& groups,
                                  const ResidueFactors& factors, const DataNoise& noise) {
  const Eigen::Index n_y = problem.n_outputs;
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, groups);
  CorrelatedColumns inputs;
  for (Eigen::Index u = 0; u < problem.n_inputs; ++u)
    inputs.parameters.push_back(parameters_of(problem, beta, factors, n_y * u, n_y));
  inputs.columns = [&](Eigen::Index u, Eigen::Index y, LineRange lines, Eigen::MatrixXd& re,
                       Eigen::MatrixXd& im) {
    const Eigen::Index c = y + n_y * u;
    free_columns(problem, beta, factors, *group_of[static_cast<std::size_t>(c)], c,
                 inputs.parameters[static_cast<std::size_t>(u)], lines, re, im);
    const Eigen::ArrayXd weight = noise_scale(problem, noise, c, lines);
    re.array().colwise() *= weight;
    im.array().colwise() *= weight;
  };
  return correlated_gram(problem, noise.correlation, factors.size(), inputs);
}

/// Variances of the numerators of one channel: rows of T over its functions.
Eigen::VectorXd numerator_variances(const FitProblem& problem, const FitParameters& beta,
                                    const ResidueFactors& factors, Eigen::Index c,
                                    const Eigen::MatrixXd& C) {
  std::vector<ResidueFactors::Entry> entries;
  factors.channel_entries(beta, c, entries);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(problem.functions());
  for (const ResidueFactors::Entry& t : entries)
    for (const ResidueFactors::Entry& o : entries)
      if (t.function == o.function)
        out[t.function] += t.value * C(t.parameter, o.parameter) * o.value;
  return out;
}

}  // namespace

LowRankParameters low_rank_parameters(const FitProblem& problem, const FitParameters& beta,
                                      const std::vector<BasisGroup>& groups, double cost,
                                      const ResidueFactors& factors, const DataNoise& noise,
                                      const std::vector<Eigen::Index>& frozen) {
  const auto reduced = [&](const FitProblem& one) {
    return factors.reduced_matrix(
        beta, ArrowSystem(one, beta, groups, FitMethod::gn, ChannelEquationsUse::only_kept));
  };
  const Eigen::MatrixXd N = reduced(problem);
  Eigen::MatrixXd K = N;
  if (noise.correlation.known()) {
    K = correlated_middle(problem, beta, groups, factors, noise);
  } else if (noise.variance) {
    K = reduced(middle_problem(problem, noise));
  }
  LowRankParameters out;
  out.residual_scale = covariance_scale(problem, cost, factors.size(), noise);
  const Eigen::MatrixXd inverse = free_inverse(N, frozen);
  out.sandwich = 0.5 * out.residual_scale * inverse * K * inverse.transpose();
  out.likelihood = 0.5 * out.residual_scale * inverse;
  if (!out.sandwich.allFinite()) return {};
  return out;
}

ParameterCovariance low_rank_covariance(const FitProblem& problem, const FitParameters& beta,
                                        double cost, const ResidueFactors& factors,
                                        const DataNoise& noise,
                                        const std::vector<Eigen::Index>& frozen,
                                        bool with_response) {
  const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, true);
  const LowRankParameters free =
      low_rank_parameters(problem, beta, groups, cost, factors, noise, frozen);
  const Eigen::MatrixXd& C = free.sandwich;
  if (C.size() == 0) return {};
  ParameterCovariance out;
  out.residual_scale = free.residual_scale;

  out.globals = C.topLeftCorner(problem.globals(), problem.globals());
  out.numerator_variance.resize(problem.channels(), problem.functions());
  if (with_response) out.response_variance.resize(problem.channels(), problem.size());
  for (const BasisGroup& group : groups)
    for_each_task(problem.threads, static_cast<int>(group.channels.size()), [&](int r) {
      const Eigen::Index c = group.channels[static_cast<std::size_t>(r)];
      const std::vector<Eigen::Index> own = parameters_of(problem, beta, factors, c, 1);
      out.numerator_variance.row(c) = numerator_variances(problem, beta, factors, c, C).transpose();
      if (!with_response) return;
      Eigen::MatrixXd re;
      Eigen::MatrixXd im;
      free_columns(problem, beta, factors, group, c, own, {0, problem.size()}, re, im);
      out.response_variance.row(c) = quadratic(re, im, C(own, own), re, im).transpose();
    });
  return out;
}

}  // namespace stageid
