#include "estimation/uncertainty/parameter_covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "estimation/model/poles.hpp"
#include "estimation/products/weighted_products.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/threads/parcel.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

// Of conjugate gradients; the variances are corrected with the residual, so their error is its square.
constexpr double kColumnTolerance = 1e-2;

/// The part of the columns of the globals that the numerators of the channel cannot follow: J_a - F Z, with Z the rows
/// of M_bb^-1 M_ba of the channel.
SplitMatrix projected_columns(const FitProblem& problem, const FitParameters& beta,
                              const BasisGroup& group, const Eigen::MatrixXd& Z, Eigen::Index c,
                              DataRange lines) {
  SplitMatrix out = global_columns(problem, beta, group, c, lines);
  out.re -= group.F.re.middleRows(lines.first, lines.count) * Z;
  out.im -= group.F.im.middleRows(lines.first, lines.count) * Z;
  return out;
}

/// Channels whose equations are stored together: all that are correlated with each other.
std::vector<DataRange> channel_parts(const FitProblem& problem, const DataNoise& noise) {
  const Eigen::Index together = noise.correlation.between_inputs() ? problem.channels()
                                : noise.correlation.known()        ? problem.n_outputs
                                                                   : 1;
  return ranges_of(problem.channels(),
                   std::max<Eigen::Index>(1, kTileChannels / together) * together);
}

/// The equations of some channels, M and K = sum Re{J^H W C W J}, with uncorrelated noise of the channels.
struct PartEquations {
  ArrowSystem gn;
  std::optional<ArrowSystem> weighed;  ///< with the weights W C W; empty: K = M
  const ArrowSystem& middle() const { return weighed ? *weighed : gn; }
};

/// K for the globals without the part of their columns that the numerators can follow, J_a - F Z.
Eigen::MatrixXd projected_middle(const PartEquations& part, DataRange range) {
  Eigen::MatrixXd K = part.middle().M_globals();
  for (Eigen::Index c = range.first; c < range.first + range.count; ++c) {
    const Eigen::MatrixXd& Z = part.gn.channel(c).Z;
    const ArrowSystem::Channel& k = part.middle().channel(c);
    K -= Z.transpose() * k.ba + k.ab * Z;
    K += Z.transpose() * k.bb * Z;
  }
  return K;
}

/// The same with correlated channels. @param cross of every channel with its numerators, globals x n_f each: those of
/// this part are filled
Eigen::MatrixXd correlated_middle(const FitProblem& problem, const FitParameters& beta,
                                  const std::vector<const BasisGroup*>& group_of,
                                  const PartEquations& part, DataRange range,
                                  const DataNoise& noise, std::vector<Eigen::MatrixXd>& cross) {
  const Eigen::Index n_y = problem.n_outputs;
  for (Eigen::Index c = range.first; c < range.first + range.count; ++c)
    cross[c].setZero(problem.globals(), problem.functions());
  CorrelatedColumns inputs;
  inputs.parameters.assign(range.count / n_y, indices(0, problem.globals()));
  inputs.columns = [&](Eigen::Index u, Eigen::Index y, DataRange lines) {
    const Eigen::Index c = range.first + n_y * u + y;
    return noise_scaled(
        problem, noise, c, lines,
        projected_columns(problem, beta, *group_of[c], part.gn.channel(c).Z, c, lines));
  };
  inputs.use = [&](Eigen::Index u, DataRange lines, const OutputColumns& Z) {
    for (Eigen::Index y = 0; y < n_y; ++y) {
      const Eigen::Index c = range.first + n_y * u + y;
      const SplitMatrix of_output = columns_of_output(Z, y, n_y);
      const SplitMatrix F = noise_scaled(problem, noise, c, lines,
                                         group_of[c]->F.middle_rows(lines.first, lines.count));
      cross[c] += of_output.re.transpose() * F.re + of_output.im.transpose() * F.im;
    }
  };
  return correlated_gram(problem, noise.correlation, problem.globals(), inputs);
}

/// The nearest covariance matrix, in units of the deviations. Rounding of nearly undetermined parameters, or two
/// estimates of one noise, can leave negative eigenvalues; they are set to zero.
Eigen::MatrixXd nearest_covariance(const Eigen::MatrixXd& C) {
  const Eigen::VectorXd deviation = C.diagonal().cwiseAbs().cwiseMax(1e-300).cwiseSqrt();
  const Eigen::VectorXd scale = deviation.cwiseInverse();
  const Eigen::MatrixXd scaled =
      scale.asDiagonal() * (0.5 * (C + C.transpose())) * scale.asDiagonal();
  const auto parts = symmetric_eigen(scaled);
  const Eigen::MatrixXd root = deviation.asDiagonal() * parts.eigenvectors() *
                               parts.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  return root * root.transpose();
}

/// A sum of squares minus the part that the numerators follow; rounding can leave it indefinite.
Eigen::MatrixXd definite_middle(const Eigen::MatrixXd& K) {
  const Eigen::VectorXd scale = K.diagonal().cwiseAbs().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> factors(scale.asDiagonal() * K * scale.asDiagonal());
  return factors.isPositive() ? K : nearest_covariance(K);
}

/// Channel and globals together as a covariance, even if the parts were not.
ChannelCovariance made_definite(const ChannelCovariance& channel, Eigen::MatrixXd& globals) {
  const Eigen::Index g = globals.rows();
  const Eigen::Index n = channel.own.rows();
  Eigen::MatrixXd whole(g + n, g + n);
  whole << globals, channel.cross, channel.cross.transpose(), channel.own;
  const Eigen::MatrixXd definite = nearest_covariance(whole);
  globals = definite.topLeftCorner(g, g);
  return {definite.bottomRightCorner(n, n), definite.topRightCorner(g, n), channel.Z,
          channel.equations_inverse};
}

/// The variances of the numerators and the response of the channel with these covariances.
struct ChannelVariances {
  Eigen::VectorXd numerators;
  Eigen::VectorXd response;  ///< empty unless requested

  bool negative() const {
    return numerators.minCoeff() < 0.0 || (response.size() > 0 && response.minCoeff() < 0.0);
  }
};

ChannelVariances channel_variances(const FitProblem& problem, const FitParameters& beta,
                                   const BasisGroup& group, Eigen::Index c,
                                   const ChannelCovariance& channel, const Eigen::MatrixXd& globals,
                                   bool with_response) {
  const Eigen::MatrixXd& Z = channel.Z;
  ChannelVariances out;
  out.numerators = channel.own.diagonal();
  if (problem.globals() > 0)
    out.numerators +=
        (Z * globals).cwiseProduct(Z).rowwise().sum() - 2.0 * (Z * channel.cross).diagonal();
  if (!with_response) return out;
  out.response = quadratic(group.F, channel.own, group.F);
  if (problem.globals() == 0) return out;
  const SplitMatrix J = projected_columns(problem, beta, group, Z, c, {0, problem.size()});
  out.response += quadratic(J, globals, J);
  out.response += 2.0 * quadratic(J, channel.cross, group.F);
  return out;
}

/// The variances of the numerators and the response of the channel; out.globals is already filled.
void fill_channel(const FitProblem& problem, const FitParameters& beta, const BasisGroup& group,
                  Eigen::Index c, const ChannelCovariance& channel, ParameterCovariance& out) {
  const bool with_response = out.response_variance.size() > 0;
  ChannelVariances variances =
      channel_variances(problem, beta, group, c, channel, out.globals, with_response);
  if (variances.negative()) {
    Eigen::MatrixXd globals = out.globals;
    const ChannelCovariance definite = made_definite(channel, globals);
    variances = channel_variances(problem, beta, group, c, definite, globals, with_response);
  }
  // Negative values are rounding errors of a zero sum.
  out.numerator_variance.row(c) = variances.numerators.cwiseMax(0.0).transpose();
  if (with_response) out.response_variance.row(c) = variances.response.cwiseMax(0.0).transpose();
}

void leave_unknown(const FitProblem& problem, Eigen::Index c, ParameterCovariance& out) {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  out.numerator_variance.row(c).setConstant(unknown);
  if (out.response_variance.size() > 0) out.response_variance.row(c).setConstant(unknown);
  if (!out.parts) return;
  const Eigen::Index n_f = problem.functions();
  const Eigen::Index globals = problem.globals();
  out.parts->channels[c] = {
      Eigen::MatrixXd::Constant(n_f, n_f, unknown), Eigen::MatrixXd::Zero(globals, n_f),
      Eigen::MatrixXd::Zero(n_f, globals), Eigen::MatrixXd::Constant(n_f, n_f, unknown)};
}

void resize(const FitProblem& problem, bool with_response, ParameterCovariance& out) {
  out.numerator_variance.setZero(problem.channels(), problem.functions());
  if (with_response) out.response_variance.setZero(problem.channels(), problem.size());
}

/// Calls task(channel) for some channels. @returns whether all calls returned true
bool fill_channels(DataRange range, int threads, const std::function<bool(Eigen::Index)>& task) {
  std::atomic<bool> determined = true;
  for_each_task(threads, static_cast<int>(range.count), [&](int r) {
    if (!task(range.first + r)) determined = false;
  });
  return determined;
}

/// Free delays are the last globals; one delay of the plant is that of every input.
void fill_delay_deviations(const FitProblem& problem, const Eigen::MatrixXd& globals,
                           AdditiveModel& model) {
  if (problem.delays() == 0) return;
  const Eigen::VectorXd deviation =
      globals.diagonal().tail(problem.delays()).cwiseMax(0.0).cwiseSqrt();
  const bool common = problem.delay == DelayModel::estimate;
  model.input_delay_std_s.setConstant(problem.n_inputs, deviation[0]);
  model.output_delay_std_s.setZero(problem.n_outputs);
  if (common) return;
  model.input_delay_std_s = deviation.head(problem.n_inputs);
  model.output_delay_std_s.head(problem.n_outputs - 1) = deviation.tail(problem.n_outputs - 1);
}

}  // namespace

Eigen::MatrixXd free_inverse(const Eigen::MatrixXd& S, const std::vector<Eigen::Index>& frozen) {
  if (S.size() == 0) return S;
  Eigen::MatrixXd reduced = S;
  hold_unknowns(frozen, reduced);
  const Eigen::VectorXd scale =
      reduced.diagonal().cwiseAbs().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd inverse =
      scale.asDiagonal() *
      (scale.asDiagonal() * reduced * scale.asDiagonal()).fullPivLu().inverse() *
      scale.asDiagonal();
  for (const Eigen::Index i : frozen) {
    inverse.row(i).setZero();
    inverse.col(i).setZero();
  }
  return inverse;
}

Eigen::VectorXd quadratic(const SplitMatrix& X, const Eigen::MatrixXd& C, const SplitMatrix& Y) {
  return (X.re * C).cwiseProduct(Y.re).rowwise().sum() +
         (X.im * C).cwiseProduct(Y.im).rowwise().sum();
}

ParameterCovariance parameter_covariance(const FitProblem& problem, const FitParameters& beta,
                                         const std::vector<BasisGroup>& groups, double cost,
                                         const DataNoise& noise,
                                         const std::vector<Eigen::Index>& frozen,
                                         WantedCovariance wanted) {
  ParameterCovariance out;
  out.residual_scale = covariance_scale(problem, cost, problem.parameters(), noise.knowledge);
  const double half = 0.5 * out.residual_scale;
  const bool correlate = problem.globals() > 0 && noise.correlation.known();
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, groups);
  const std::vector<DataRange> parts = channel_parts(problem, noise);
  std::optional<FitProblem> weighed;
  if (noise.variance) weighed = middle_problem(problem, noise);
  std::optional<PartEquations> equations;
  const auto make_equations = [&](DataRange part) {
    equations.emplace(
        PartEquations{ArrowSystem(problem, beta, groups, FitMethod::gn, part), std::nullopt});
    if (weighed)
      equations->weighed.emplace(*weighed, beta, groups, FitMethod::gn, part,
                                 ChannelEquationsUse::only_kept);
  };

  // Each process has the equations of its own parts; nothing but S and K is summed, and the variances gathered.
  const Team& team = *problem.team;
  const auto tiles = std::ssize(parts);
  const TileShare own = team.share(tiles);
  const Eigen::Index globals = problem.globals();
  std::vector<Eigen::VectorXd> sums;
  std::vector<Eigen::MatrixXd> cross(correlate ? static_cast<std::size_t>(problem.channels())
                                               : std::size_t{0});
  for (Eigen::Index p = own.first; p < own.first + own.count; ++p) {
    const DataRange part = parts[p];
    make_equations(part);
    Eigen::VectorXd& sum = sums.emplace_back(Eigen::VectorXd::Zero(2 * globals * globals + 1));
    if (!equations->gn.regular()) {
      sum.tail(1).setOnes();
      continue;
    }
    sum << equations->gn.schur().reshaped(),
        (correlate ? correlated_middle(problem, beta, group_of, *equations, part, noise, cross)
                   : projected_middle(*equations, part))
            .reshaped(),
        0.0;
  }
  const Eigen::VectorXd sum = team.sum(tiles, 2 * globals * globals + 1, sums);
  if (sum.tail(1)[0] > 0.0) return {};
  const Eigen::MatrixXd S = sum.head(globals * globals).reshaped(globals, globals);
  const Eigen::MatrixXd K =
      sum.segment(globals * globals, globals * globals).reshaped(globals, globals);
  const Eigen::MatrixXd inverse = free_inverse(S, frozen);
  if (problem.globals() > 0)
    out.globals = half * inverse * definite_middle(K) * inverse.transpose();

  // The equations of a part are computed again: storing all of them would need more memory than the data.
  resize(problem, wanted.response, out);
  if (wanted.parts)
    out.parts = std::make_shared<CovarianceParts>(
        CovarianceParts{out.globals, inverse, out.residual_scale,
                        std::vector<ChannelCovariance>(problem.channels())});
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(problem.functions(), problem.functions());
  bool all_determined = true;
  for (Eigen::Index p = own.first; p < own.first + own.count && all_determined; ++p) {
    const DataRange part = parts[p];
    if (own.count > 1) make_equations(part);
    all_determined = fill_channels(part, problem.threads, [&](Eigen::Index c) {
      const ArrowSystem::Channel& gn = equations->gn.channel(c);
      const ArrowSystem::Channel& k = equations->middle().channel(c);
      if (has_no_weight(problem, c)) {
        leave_unknown(problem, c, out);
        return true;
      }
      Eigen::MatrixXd bb_inverse;
      if (!solve_scaled(gn.bb, unit, bb_inverse)) return false;
      const Eigen::MatrixXd& k_ab =
          correlate ? cross[c] : Eigen::MatrixXd(k.ab - gn.Z.transpose() * k.bb);
      ChannelCovariance channel = {half * bb_inverse * k.bb * bb_inverse,
                                   half * inverse * k_ab * bb_inverse, gn.Z, bb_inverse};
      fill_channel(problem, beta, *group_of[c], c, channel, out);
      if (out.parts) out.parts->channels[c] = std::move(channel);
      return true;
    });
  }
  if (team.divides(tiles)) {
    if (team.any(!all_determined)) return {};
    team.gather_rows(parts.front().count, out.numerator_variance);
    team.gather_rows(parts.front().count, out.response_variance);
    for (int owner = 0; wanted.parts && owner < team.size(); ++owner) {
      const TileShare of_owner = team.share(tiles, owner);
      for (Eigen::Index p = of_owner.first; p < of_owner.first + of_owner.count; ++p)
        for (Eigen::Index c = parts[p].first; c < parts[p].first + parts[p].count; ++c)
          for (Eigen::MatrixXd ChannelCovariance::*const matrix :
               {&ChannelCovariance::own, &ChannelCovariance::cross, &ChannelCovariance::Z,
                &ChannelCovariance::equations_inverse})
            broadcast(team, owner, out.parts->channels[c].*matrix);
    }
  }
  if (!all_determined) return {};
  return out;
}

ParameterCovariance joint_covariance(const FitProblem& problem, const FitParameters& beta,
                                     const std::vector<BasisGroup>& groups, double cost,
                                     const JointEquations& equations, VarianceKnowledge knowledge,
                                     double scatter_factor, const std::vector<Eigen::Index>& frozen,
                                     bool with_response) {
  ParameterCovariance out;
  if (!equations.regular()) return out;
  out.residual_scale = covariance_scale(problem, cost, problem.parameters(), knowledge);
  const double half = 0.5 * scatter_factor * out.residual_scale;

  // Columns of M^-1 for the globals: X_a of the globals themselves, X_b of the numerators. With X = M^-1
  // - dX and residuals R = M dX,  X_a + X^T R = (M^-1)_aa - dX^T M dX.
  const Eigen::Index globals = problem.globals();
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(equations.size(), globals);
  Eigen::MatrixXd R = X;
  for (Eigen::Index i = 0; i < globals; ++i) {
    if (std::ranges::find(frozen, i) != frozen.end()) continue;
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(equations.size(), i);
    const JointEquations::Solution column = equations.solve(unit, frozen, kColumnTolerance);
    X.col(i) = column.x;
    R.col(i) = column.residual;
  }
  Eigen::MatrixXd X_a = X.topRows(globals) + X.transpose() * R;
  X_a = (0.5 * (X_a + X_a.transpose())).eval();
  out.globals = half * X_a;
  const Eigen::MatrixXd Z = -X.bottomRows(X.rows() - globals) * free_inverse(X_a, frozen);

  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(problem.functions(), problem.functions());
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(globals, problem.functions());
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, groups);
  resize(problem, with_response, out);
  const bool determined =
      fill_channels({0, problem.channels()}, problem.threads, [&](Eigen::Index c) {
        const ArrowSystem::Channel& arrow = equations.preconditioner().channel(c);
        if (has_no_weight(problem, c)) {
          leave_unknown(problem, c, out);
          return true;
        }
        Eigen::MatrixXd own;
        if (!solve_scaled(arrow.bb, unit, own)) return false;
        const Eigen::MatrixXd Z_c =
            Z(Eigen::seqN(c, problem.functions(), problem.channels()), Eigen::all);
        fill_channel(problem, beta, *group_of[c], c, {half * own, none, Z_c, own}, out);
        return true;
      });
  if (!determined) return {};
  return out;
}

void fill_deviations(const FitProblem& problem, const ParameterCovariance& covariance,
                     AdditiveModel& model) {
  fill_delay_deviations(problem, covariance.globals, model);
  Eigen::Index first = 0;
  Eigen::Index f = 0;
  for (Submodel& s : model.submodels) {
    const Eigen::Index order = s.order();
    if (s.is_mode() && s.held != HeldPole::guess) {
      const Eigen::Matrix2d C = covariance.globals.block<2, 2>(first, first);
      const double a1 = s.denominator[1];
      const double a2 = s.denominator[2];
      const Eigen::Vector2d df(0.0, -0.5 * s.natural_frequency_hz() / a2);
      const Eigen::Vector2d dz = s.damping_ratio() * Eigen::Vector2d(1.0 / a1, -0.5 / a2);
      // Zero: the mode is at a bound, so the data do not determine its frequency or damping.
      if (C(1, 1) > 0.0) s.natural_frequency_std_hz = std::sqrt(std::max(0.0, df.dot(C * df)));
      if (C(1, 1) > 0.0 && C(0, 0) > 0.0)
        s.damping_ratio_std = std::sqrt(std::max(0.0, dz.dot(C * dz)));
    } else if (!s.is_mode() && order > 0) {
      const Eigen::MatrixXd C = covariance.globals.block(first, first, order, order);
      if (C.diagonal().minCoeff() > 0.0) s.poles = pole_estimates(s.coefficients(), C);
    }
    first += order;
    for (const Eigen::MatrixXd& B : s.numerator)
      s.numerator_std.emplace_back(
          covariance.numerator_variance.col(f++)
              .unaryExpr([](double v) { return v < 0.0 ? 0.0 : std::sqrt(v); })
              .reshaped(B.rows(), B.cols()));
  }
}

}  // namespace stageid
