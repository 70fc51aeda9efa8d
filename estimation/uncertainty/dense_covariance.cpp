#include "estimation/uncertainty/dense_covariance.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <utility>

#include "estimation/problem/fit_start.hpp"
#include "estimation/problem/residual.hpp"
#include "estimation/problem/weight_matrices.hpp"
#include "estimation/uncertainty/low_rank_covariance.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

/// A completed fit as input of its equations.
struct Ended {
  std::optional<WeightMatrices> matrices;
  FitProblem problem;
  FitParameters beta;
  std::vector<BasisGroup> groups;
};

Ended ended_fit(const FrfEstimate& frf, const FitResult& result, const FitOptions& options) {
  Ended out;
  out.matrices = make_weight_matrices(frf, options);
  out.problem =
      make_problem(frf, result.model, options,
                   out.matrices ? SharedMatrix<Eigen::MatrixXd>::kept(out.matrices->marginal())
                                : make_weights(frf, options));
  drop_guesses(result.model, out.problem.held);
  out.beta = make_parameters(out.problem, result.model, options);
  out.groups = evaluate_groups(out.problem, out.beta, true);
  return out;
}

/// Columns X_c of every channel, all of one width, and the weights between two channels.
struct ChannelPairs {
  Eigen::Index lines = 0;
  std::function<SplitMatrix(Eigen::Index c, DataRange lines)> columns;
  /// W(c, d) on some lines, lines x 1; empty: zero.
  std::function<SplitMatrix(Eigen::Index c, Eigen::Index d, DataRange lines)> between;
};

// The columns of a block of channels and of one further channel remain in the cache.
constexpr Eigen::Index kBlockLines = 64;
constexpr Eigen::Index kBlockChannels = 8;

/// The place of the pair c <= d.
Eigen::Index pair_place(Eigen::Index c, Eigen::Index d) { return d * (d + 1) / 2 + c; }

/// Adds the products of a block of channels and the following ones on a tile of lines.
/// @param sums per pair of channels, the products of every range, by columns
void add_channels(const ChannelPairs& pairs, const std::vector<SplitMatrix>& X, DataRange block,
                  DataRange lines, const std::vector<DataRange>& ranges, Eigen::MatrixXd& sums) {
  SplitMatrix right;
  for (Eigen::Index d = block.first; d < std::ssize(X); ++d)
    for (Eigen::Index c = block.first; c <= std::min(d, block.first + block.count - 1); ++c) {
      const SplitMatrix weight = pairs.between(c, d, lines);
      if (weight.cols() == 0) continue;
      const auto w_re = weight.re.col(0).array();
      const auto w_im = weight.im.col(0).array();
      double* sum = sums.col(pair_place(c, d)).data();
      for (const auto& [first, n] : ranges) {
        const auto re = X[d].re.middleCols(first, n).array();
        const auto im = X[d].im.middleCols(first, n).array();
        right.re = re.colwise() * w_re - im.colwise() * w_im;
        right.im = im.colwise() * w_re + re.colwise() * w_im;
        // Of a mode, two columns each: packing them for the usual product takes longer than the product.
        Eigen::Map<Eigen::MatrixXd> gram(sum, n, n);
        gram += X[c].re.middleCols(first, n).transpose().lazyProduct(right.re);
        gram += X[c].im.middleCols(first, n).transpose().lazyProduct(right.im);
        sum += n * n;
      }
    }
}

/// sum_k Re{X_c^H W(c, d) X_d} of the columns in a range, for every range: element (c + n_c p, d + n_c q) belongs to
/// its columns p and q, in the order of vec of channels x columns. W must be Hermitian.
std::vector<Eigen::MatrixXd> pair_grams(const FitProblem& problem, const ChannelPairs& pairs,
                                        const std::vector<DataRange>& ranges) {
  const Eigen::Index channels = problem.channels();
  Eigen::Index products = 0;
  for (const DataRange& range : ranges) products += range.count * range.count;
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(products, pair_place(0, channels));
  std::vector<SplitMatrix> X(channels);
  const std::vector<DataRange> blocks = ranges_of(channels, kBlockChannels);
  for (const DataRange lines : ranges_of(pairs.lines, kBlockLines)) {
    for_each_task(problem.threads, static_cast<int>(channels),
                  [&](int c) { X[c] = pairs.columns(c, lines); });
    for_each_task(problem.threads, static_cast<int>(blocks.size()),
                  [&](int b) { add_channels(pairs, X, blocks[b], lines, ranges, sums); });
  }

  std::vector<Eigen::MatrixXd> out;
  Eigen::Index row = 0;
  for (const DataRange& range : ranges) {
    const Eigen::Index n = range.count;
    Eigen::MatrixXd& all = out.emplace_back(channels * n, channels * n);
    for (Eigen::Index d = 0; d < channels; ++d)
      for (Eigen::Index c = 0; c <= d; ++c) {
        const auto gram = sums.col(pair_place(c, d)).segment(row, n * n).reshaped(n, n);
        all(Eigen::seqN(c, n, channels), Eigen::seqN(d, n, channels)) = gram;
        all(Eigen::seqN(d, n, channels), Eigen::seqN(c, n, channels)) = gram.transpose();
      }
    row += n * n;
  }
  return out;
}

/// Covariance of (a, b) from that of a, that of nu and that between a and nu; b = nu - Z a.
Eigen::MatrixXd joined(const Eigen::MatrixXd& a, const Eigen::MatrixXd& nu,
                       const Eigen::MatrixXd& cross, const Eigen::MatrixXd& Z) {
  const Eigen::Index n = a.rows();
  Eigen::MatrixXd out(n + nu.rows(), n + nu.rows());
  const Eigen::MatrixXd product = Z * cross;
  out.topLeftCorner(n, n) = a;
  out.topRightCorner(n, nu.rows()) = cross - a * Z.transpose();
  out.bottomLeftCorner(nu.rows(), n) = out.topRightCorner(n, nu.rows()).transpose();
  out.bottomRightCorner(nu.rows(), nu.rows()) =
      nu - product - product.transpose() + Z * a * Z.transpose();
  return out;
}

/// Cov(nu) between channels, 1/2 sum Re{g_c^H C(c, d) g_d} with g = W F M_bb^-1, zero unless they are correlated. The
/// diagonal blocks are those of the channels, which are known.
std::vector<Eigen::MatrixXd> between_channels(const Ended& fit, const DataNoise& noise, double half,
                                              const CovarianceParts& known,
                                              const std::vector<DataRange>& ranges) {
  const FitProblem& problem = fit.problem;
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, fit.groups);
  ChannelPairs pairs;
  pairs.lines = noise.correlation.known() ? problem.size() : 0;
  pairs.columns = [&](Eigen::Index c, DataRange lines) {
    const Eigen::MatrixXd& inverse = known.channels[c].equations_inverse;
    const auto& [F_re, F_im] = group_of[c]->F;
    return noise_scaled(problem, noise, c, lines,
                        {F_re.middleRows(lines.first, lines.count) * inverse,
                         F_im.middleRows(lines.first, lines.count) * inverse});
  };
  pairs.between = [&](Eigen::Index c, Eigen::Index d, DataRange lines) {
    return c == d ? SplitMatrix{} : noise.correlation.of_channels(c, d, lines);
  };
  std::vector<Eigen::MatrixXd> out = pair_grams(problem, pairs, ranges);
  for (Eigen::MatrixXd& matrix : out) matrix *= half;
  return out;
}

std::vector<FitCovariance> of_free_numerators(const FrfEstimate& frf, const Ended& fit,
                                              const FitResult& result, const FitOptions& options,
                                              const std::vector<DataRange>& ranges) {
  const FitProblem& problem = fit.problem;
  const DataNoise noise = data_noise(frf, options.weighting);
  const std::shared_ptr<const CovarianceParts> parts =
      result.covariance_parts
          ? result.covariance_parts
          : parameter_covariance(problem, fit.beta, fit.groups, result.model.fit.cost, noise,
                                 result.frozen, {false, true})
                .parts;
  if (!parts) return {};
  const CovarianceParts& known = *parts;
  const double half = 0.5 * known.residual_scale;
  std::vector<Eigen::MatrixXd> nu = between_channels(fit, noise, half, known, ranges);
  std::vector<FitCovariance> out;
  for (std::size_t r = 0; r < ranges.size(); ++r) {
    const auto [first, n] = ranges[r];
    Eigen::MatrixXd Z(nu[r].rows(), problem.globals());
    Eigen::MatrixXd cross(problem.globals(), nu[r].rows());
    Eigen::MatrixXd likelihood = Eigen::MatrixXd::Zero(nu[r].rows(), nu[r].cols());
    for (Eigen::Index c = 0; c < problem.channels(); ++c) {
      const auto own = Eigen::seqN(c, n, problem.channels());
      const ChannelCovariance& channel = known.channels[c];
      Z(own, Eigen::all) = channel.Z.middleRows(first, n);
      cross(Eigen::all, own) = channel.cross.middleCols(first, n);
      nu[r](own, own) = channel.own.block(first, first, n, n);
      likelihood(own, own) = half * channel.equations_inverse.block(first, first, n, n);
    }
    out.push_back({joined(known.globals, nu[r], cross, Z),
                   joined(half * known.globals_inverse, likelihood,
                          Eigen::MatrixXd::Zero(problem.globals(), nu[r].rows()), Z)});
  }
  return out;
}

/// The rows of T, d (globals, numerators of the range) / d free parameters, times C times T^T.
Eigen::MatrixXd of_factors(const FitProblem& problem, const FitParameters& beta,
                           const ResidueFactors& factors, const DataRange& range,
                           const Eigen::MatrixXd& C) {
  const Eigen::Index globals = problem.globals();
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(globals + problem.channels() * range.count, C.cols());
  T.topLeftCorner(globals, globals).setIdentity();
  for (Eigen::Index c = 0; c < problem.channels(); ++c)
    for (const auto& [function, parameter, value] : factors.channel_entries(beta, c)) {
      const Eigen::Index place = function - range.first;
      if (place < 0 || place >= range.count) continue;
      T(globals + c + problem.channels() * place, parameter) += value;
    }
  return T * C * T.transpose();
}

std::vector<FitCovariance> of_given_ranks(const FrfEstimate& frf, const Ended& fit,
                                          const FitResult& result, const FitOptions& options,
                                          const std::vector<DataRange>& ranges) {
  ResidueFactors factors(fit.problem, fit.beta, options);
  factors.project(fit.beta, Eigen::MatrixXd::Ones(fit.problem.channels(), fit.problem.functions()));
  const FitCovariance free =
      low_rank_parameters(fit.problem, fit.beta, fit.groups, result.model.fit.cost, factors,
                          data_noise(frf, options.weighting), result.frozen);
  std::vector<FitCovariance> out;
  if (free.sandwich.size() == 0) return out;
  for (const DataRange& range : ranges)
    out.push_back({of_factors(fit.problem, fit.beta, factors, range, free.sandwich),
                   of_factors(fit.problem, fit.beta, factors, range, free.likelihood)});
  return out;
}

/// M of all parameters under weight matrices: globals by products, numerators by pairs of channels.
Eigen::MatrixXd joint_matrix(const Ended& fit) {
  const FitProblem& problem = fit.problem;
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, fit.groups);
  const JointEquations equations(problem, *fit.matrices, fit.beta, fit.groups,
                                 residual(problem, fit.groups, fit.beta.B));
  ChannelPairs pairs;
  pairs.lines = problem.size();
  pairs.columns = [&](Eigen::Index c, DataRange lines) {
    return group_of[c]->F.middle_rows(lines.first, lines.count);
  };
  pairs.between = [&](Eigen::Index c, Eigen::Index d, DataRange lines) {
    return fit.matrices->between(c, d, lines.first, lines.count);
  };
  const Eigen::Index globals = problem.globals();
  Eigen::MatrixXd M(equations.size(), equations.size());
  for (Eigen::Index i = 0; i < globals; ++i) {
    M.col(i) = equations.product(Eigen::VectorXd::Unit(equations.size(), i));
    M.row(i) = M.col(i).transpose();
  }
  M.bottomRightCorner(M.rows() - globals, M.cols() - globals) =
      pair_grams(problem, pairs, {{0, problem.functions()}}).front();
  return M;
}

std::vector<FitCovariance> of_weight_matrices(const Ended& fit, const FitResult& result,
                                              const FitOptions& options,
                                              const std::vector<DataRange>& ranges) {
  const FitProblem& problem = fit.problem;
  const double half =
      0.5 * covariance_scale(problem, result.model.fit.cost, problem.parameters(),
                             weighs_by_variance(options.weighting) ? VarianceKnowledge::weights
                                                                   : VarianceKnowledge::none);
  const Eigen::MatrixXd inverse = free_inverse(joint_matrix(fit), result.frozen);
  if (!inverse.allFinite()) return {};
  std::vector<FitCovariance> out;
  for (const DataRange& range : ranges) {
    std::vector<Eigen::Index> places = indices(0, problem.globals());
    for (Eigen::Index i = 0; i < problem.channels() * range.count; ++i)
      places.push_back(problem.globals() + problem.channels() * range.first + i);
    const Eigen::MatrixXd part = half * inverse(places, places);
    out.push_back({fit.matrices->scatter_factor() * part, part});
  }
  return out;
}

/// Whether the ranges together have no more numbers than one covariance of kMostParameters.
bool are_affordable(const FitProblem& problem, const std::vector<DataRange>& ranges) {
  const auto most = static_cast<double>(kMostParameters);
  double numbers = 0.0;
  for (const DataRange& range : ranges)
    numbers += std::pow(problem.globals() + problem.channels() * range.count, 2);
  return numbers <= most * most;
}

bool has_deviations(const FitResult& result) {
  return result.status() != FitStatus::singular &&
         std::ranges::all_of(result.model.submodels,
                             [](const Submodel& s) { return !s.numerator_std.empty(); });
}

std::vector<FitCovariance> covariances_of(const FrfEstimate& frf, const Ended& fit,
                                          const FitResult& result, const FitOptions& options,
                                          const std::vector<DataRange>& ranges) {
  const bool low_rank = options.residue_rank > 0 || options.rigid_body_rank > 0;
  if (!are_affordable(fit.problem, ranges) ||
      (fit.matrices && fit.problem.parameters() > kMostParameters))
    return {};
  std::vector<FitCovariance> out = fit.matrices ? of_weight_matrices(fit, result, options, ranges)
                                   : low_rank
                                       ? of_given_ranks(frf, fit, result, options, ranges)
                                       : of_free_numerators(frf, fit, result, options, ranges);
  for (FitCovariance& one : out)
    for (Eigen::MatrixXd* matrix : {&one.sandwich, &one.likelihood})  // symmetric to the last bit
      *matrix = (0.5 * frf.correlated_lines * (*matrix + matrix->transpose())).eval();
  return out;
}

constexpr double kOutside = 0.05;

double probability_above(double r, double relation) {
  constexpr int kPoints = 200;  // the midpoint rule of a smooth periodic function
  double sum = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const double t = (i + 0.5) / kPoints * std::numbers::pi / 2.0;
    const double along = (1.0 + relation) * std::pow(std::cos(t), 2);
    sum += std::exp(-r * r / (along + (1.0 - relation) * std::pow(std::sin(t), 2)));
  }
  return sum / kPoints;
}

/// error_quantile_95() interpolated in a table, within 1e-5.
class QuantileTable {
 public:
  QuantileTable() {
    for (std::size_t i = 0; i < values_.size(); ++i)
      values_[i] = error_quantile_95(static_cast<double>(i) / kIntervals);
  }
  double operator()(double relation) const {
    const double x = std::clamp(relation, 0.0, 1.0) * kIntervals;
    const auto i = std::min(static_cast<std::size_t>(x), std::size_t{kIntervals - 1});
    return std::lerp(values_[i], values_[i + 1], x - static_cast<double>(i));
  }

 private:
  static constexpr int kIntervals = 256;
  std::array<double, kIntervals + 1> values_{};
};

/// The parameters that a channel's response depends on.
std::vector<Eigen::Index> own_parameters(const FitProblem& problem, Eigen::Index c) {
  std::vector<Eigen::Index> own = indices(0, problem.globals());
  for (Eigen::Index f = 0; f < problem.functions(); ++f)
    own.push_back(problem.globals() + c + problem.channels() * f);
  return own;
}

/// FitCovariance::response_variance and response_radius from the covariance of the parameters. Errors of a model are
/// not circular: few parameters move P along few directions.
void fill_response_errors(const Ended& fit, FitCovariance& covariance) {
  const FitProblem& problem = fit.problem;
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, fit.groups);
  covariance.response_variance.resize(problem.channels(), problem.size());
  covariance.response_radius.resize(problem.channels(), problem.size());
  for_each_task(problem.threads, static_cast<int>(problem.channels()), [&](int c) {
    const BasisGroup& group = *group_of[c];
    const std::vector<Eigen::Index> own = own_parameters(problem, c);
    const Eigen::MatrixXd C = covariance.sandwich(own, own);
    for (const DataRange lines : ranges_of(problem.size(), kTileLines)) {
      const SplitMatrix of_globals = global_columns(problem, fit.beta, group, c, lines);
      Eigen::MatrixXd re(lines.count, C.rows());
      Eigen::MatrixXd im(lines.count, C.rows());
      re << of_globals.re, group.F.re.middleRows(lines.first, lines.count);
      im << of_globals.im, group.F.im.middleRows(lines.first, lines.count);
      const Eigen::MatrixXd half = re * C;
      const Eigen::ArrayXd real = half.cwiseProduct(re).rowwise().sum();
      const Eigen::ArrayXd imaginary = (im * C).cwiseProduct(im).rowwise().sum();
      const Eigen::ArrayXd between = half.cwiseProduct(im).rowwise().sum();
      for (Eigen::Index i = 0; i < lines.count; ++i) {
        covariance.response_variance(c, lines.first + i) = std::max(real[i] + imaginary[i], 0.0);
        covariance.response_radius(c, lines.first + i) =
            disc_radius_95(real[i], imaginary[i], between[i]);
      }
    }
  });
}

}  // namespace

bool have_affordable_covariances(const FitProblem& problem, const AdditiveModel& model) {
  return are_affordable(problem, functions_of_submodels(model)) ||
         are_affordable(problem, {{0, problem.functions()}});
}

std::vector<FitCovariance> dense_covariances(const FrfEstimate& frf, const FitResult& result,
                                             const FitOptions& options,
                                             const std::vector<DataRange>& ranges) {
  if (!has_deviations(result)) return {};
  return covariances_of(frf, ended_fit(frf, result, options), result, options, ranges);
}

void fill_covariance(const FrfEstimate& frf, const FitOptions& options, FitResult& result) {
  if (!has_deviations(result)) {
    result.decisions.emplace_back("no covariance: the fit has no standard deviations");
    return;
  }
  const Ended fit = ended_fit(frf, result, options);
  std::vector<FitCovariance> all =
      covariances_of(frf, fit, result, options, {{0, fit.problem.functions()}});
  if (all.empty()) {
    result.decisions.push_back(
        fmt::format("no covariance: the fit has more than {} parameters, or they are not "
                    "identifiable; use fewer channels or modes",
                    kMostParameters));
    return;
  }
  result.covariance = std::move(all.front());
  fill_response_errors(fit, result.covariance);
}

double error_quantile_95(double relation) {
  double low = 1.0;
  double high = 3.0;
  while (high - low > 1e-9) {
    const double middle = 0.5 * (low + high);
    (probability_above(middle, relation) > kOutside ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double disc_radius_95(double real, double imaginary, double between) {
  static const QuantileTable quantile;
  const double variance = real + imaginary;
  if (!(variance > 0.0)) return std::max(variance, 0.0);
  return std::sqrt(variance) * quantile(std::hypot(real - imaginary, 2.0 * between) / variance);
}

std::vector<DataRange> functions_of_submodels(const AdditiveModel& model) {
  std::vector<DataRange> out;
  Eigen::Index next = 0;
  for (const Submodel& s : model.submodels) {
    out.push_back({next, std::ssize(s.numerator)});
    next += out.back().count;
  }
  return out;
}

}  // namespace stageid
