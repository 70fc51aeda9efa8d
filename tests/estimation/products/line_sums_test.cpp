// Sums over lines that channels share, against those of every channel by itself.

#include "estimation/products/line_sums.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/numerators.hpp"
#include "estimation/problem/residual.hpp"
#include "estimation/products/equation_method.hpp"
#include "tests/estimation/disturbed_problem.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test_line_sums {

using test::DenseProblem;
using test::measure_and_disturb;
using test::random_matrix;
using test::RandomNumbers;

/// 4 x 5 channels.
DenseProblem wide_problem(HoldModel hold) {
  RandomNumbers random(31);
  DenseProblem problem;
  problem.hold = hold;
  problem.model = test::named_model(4, 5);
  if (hold != HoldModel::none) problem.model.sample_rate_hz = 1e4;
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(300, 30.0, 1500.0);
  problem.model.submodels = {test::empty_submodel(problem.model, 2, {}, 1),
                             test::empty_mode(problem.model, 240.0, 0.03),
                             test::empty_mode(problem.model, 800.0, 0.02, 2)};
  measure_and_disturb(random, problem, 1e-3);
  return problem;
}

/// The equations of channel c in the order (functions, globals), from its own columns multiplied out.
struct ChannelEquations {
  Eigen::MatrixXd M;
  Eigen::VectorXd e;
};

ChannelEquations channel_equations(const EquationMethod& shared, const FitParameters& beta,
                                   const BasisGroup& group, Eigen::Index c) {
  const FitProblem& fit = shared.problem;
  const Eigen::Index N = fit.size();
  const Eigen::Index n_f = fit.functions();
  const SplitMatrix of_globals = global_columns(fit, beta, group, c, {0, N});
  const auto complex = [](const SplitMatrix& X) {
    return Eigen::MatrixXcd(X.re.cast<std::complex<double>>() +
                            std::complex<double>(0.0, 1.0) * X.im);
  };
  Eigen::MatrixXcd J(N, n_f + fit.globals());
  J << complex(group.F), complex(of_globals);
  const Eigen::VectorXcd E =
      fit.G->row(c).transpose() - J.leftCols(n_f) * beta.B.row(c).transpose();
  Eigen::MatrixXcd Phi = J;
  if (shared.method != FitMethod::gn)
    Phi.middleCols(n_f, fit.denominators()) -= E.asDiagonal() * complex(shared.Y);
  const Eigen::MatrixXcd instrument =
      fit.weights(c).asDiagonal() * (shared.method == FitMethod::sk ? Phi : J);
  return {(instrument.adjoint() * Phi).real(), (instrument.adjoint() * E).real()};
}

TEST(LineSums, SharedSumsAreTheChannelsOwn) {
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn, FitMethod::sk})
    for (const DelayModel delay : {DelayModel::fixed, DelayModel::estimate}) {
      const DenseProblem problem = wide_problem(HoldModel::exact);
      const auto [fit, beta, groups] = test::Evaluated(problem, delay);
      ASSERT_EQ(groups.size(), 1U);
      const ArrowSystem system(fit, beta, groups, method);
      const ArrowSystem passing(fit, beta, groups, method, ChannelEquationsUse::eliminated);
      EXPECT_EQ(system.schur(), passing.schur());

      const EquationMethod shared(fit, beta, method);
      const Eigen::Index n_f = fit.functions();
      Eigen::MatrixXd M = Eigen::MatrixXd::Zero(fit.globals(), fit.globals());
      Eigen::VectorXd e = Eigen::VectorXd::Zero(fit.globals());
      // Sums of 600 products: rounding of either is far below 1e-10 of the largest.
      const auto expect_same = [](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
        EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-10 * b.cwiseAbs().maxCoeff());
      };
      for (Eigen::Index c = 0; c < fit.channels(); ++c) {
        const ChannelEquations own = channel_equations(shared, beta, groups[0], c);
        const ArrowSystem::Channel& channel = system.channel(c);
        expect_same(channel.bb, own.M.topLeftCorner(n_f, n_f));
        expect_same(channel.ab, own.M.bottomLeftCorner(fit.globals(), n_f));
        expect_same(channel.ba, own.M.topRightCorner(n_f, fit.globals()));
        expect_same(channel.e, own.e.head(n_f));
        M += own.M.bottomRightCorner(fit.globals(), fit.globals());
        e += own.e.tail(fit.globals());
      }
      expect_same(system.M_globals(), M);
      expect_same(system.e_globals(), e);
    }
}

// A channel that cannot be eliminated does not affect the equations of the others, which modal forms and covariances
// of other weights use without elimination.
TEST(LineSums, ChannelsThatAreOnlyKeptAreAllThere) {
  DenseProblem problem = wide_problem(HoldModel::exact);
  constexpr Eigen::Index kSpoilt = 3;
  problem.W(kSpoilt, 7) = std::numeric_limits<double>::infinity();
  const auto [fit, beta, groups] = test::Evaluated(problem);
  ASSERT_FALSE(ArrowSystem(fit, beta, groups, FitMethod::gn).regular());
  const ArrowSystem kept(fit, beta, groups, FitMethod::gn, ChannelEquationsUse::only_kept);
  EXPECT_TRUE(kept.regular());
  const EquationMethod shared(fit, beta, FitMethod::gn);
  for (Eigen::Index c = 0; c < fit.channels(); ++c) {
    if (c == kSpoilt) continue;
    const ChannelEquations own = channel_equations(shared, beta, groups[0], c);
    const Eigen::MatrixXd bb = own.M.topLeftCorner(fit.functions(), fit.functions());
    const Eigen::MatrixXd ab = own.M.bottomLeftCorner(fit.globals(), fit.functions());
    EXPECT_LT((kept.channel(c).bb - bb).norm(), 1e-10 * bb.norm());
    EXPECT_LT((kept.channel(c).ab - ab).norm(), 1e-10 * ab.norm());
  }
}

TEST(LineSums, NumeratorsOfManyChannelsAreThoseOfEachAlone) {
  const DenseProblem problem = wide_problem(HoldModel::exact);
  auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::fixed, false);
  Eigen::MatrixXd together;
  const auto solved = solve_numerators(fit, groups, together);
  ASSERT_TRUE(solved);
  const double cost = solved->cost;
  EXPECT_NEAR(cost, residual_cost(fit, groups, together), 1e-12 * cost);
  const std::vector<Eigen::Index> all = groups[0].channels;
  groups.assign(all.size(), groups[0]);
  for (std::size_t c = 0; c < all.size(); ++c) groups[c].channels = {all[c]};
  Eigen::MatrixXd alone;
  const auto solved_alone = solve_numerators(fit, groups, alone);
  ASSERT_TRUE(solved_alone);
  EXPECT_LT((together - alone).cwiseAbs().maxCoeff(), 1e-10 * alone.cwiseAbs().maxCoeff());
  EXPECT_NEAR(cost, solved_alone->cost, 1e-12 * cost);
}

TEST(WeightedProducts, AreTheSumsTheySay) {
  RandomNumbers random(21);
  const Eigen::Index N = 700;  // more than two tiles
  const Eigen::MatrixXd W = random_matrix(random, 3, N).cwiseAbs();
  const Eigen::MatrixXd V = random_matrix(random, 3, N);
  const SplitMatrix X{random_matrix(random, N, 4), random_matrix(random, N, 4)};
  const SplitMatrix Y{random_matrix(random, N, 60), random_matrix(random, N, 60)};
  const auto pairs = all_pairs(4, 60);  // 240: more than one block
  Eigen::MatrixXd real = Eigen::MatrixXd::Zero(240, 3);
  Eigen::MatrixXd complex = Eigen::MatrixXd::Zero(240, 3);
  for_each_tile({0, 3, 0, N}, [&](Eigen::Index first, Eigen::Index n) {
    const Eigen::MatrixXd W_tile = W.middleCols(first, n);
    add_pair_sums(W_tile, X, Y, pairs, first, real);
    add_pair_sums(W_tile, V.middleCols(first, n), X, Y, pairs, first, complex);
  });
  for (std::size_t p = 0; p < pairs.size(); ++p)
    for (Eigen::Index c = 0; c < 3; ++c) {
      std::complex<double> with_weight = 0.0;
      std::complex<double> with_error = 0.0;
      for (Eigen::Index k = 0; k < N; ++k) {
        const std::complex<double> product = std::conj(X(k, pairs[p].left)) * Y(k, pairs[p].right);
        with_weight += W(c, k) * product;
        with_error += std::complex<double>(W(c, k), V(c, k)) * product;
      }
      // Sums of N numbers of order one.
      EXPECT_NEAR(real(static_cast<Eigen::Index>(p), c), with_weight.real(), 1e-11);
      EXPECT_NEAR(complex(static_cast<Eigen::Index>(p), c), with_error.real(), 1e-11);
    }
}

TEST(WeightedProducts, SharesCoverEveryLineOfEveryChannelOnce) {
  for (const auto& [members, lines] : {std::pair<Eigen::Index, Eigen::Index>{1, 1},
                                       {3, 256},
                                       {52, 3960},
                                       {257, 257},
                                       {1000, 5000}}) {
    Eigen::MatrixXi seen = Eigen::MatrixXi::Zero(members, lines);
    BasisGroup group;
    group.channels = indices(0, members);
    for (const TileRange& block : member_blocks(group, {0, members}, lines))
      for (const TileRange& share : line_shares(block))
        for_each_tile(share, [&, rows = share](Eigen::Index first, Eigen::Index n) {
          seen.block(rows.first_member, first, rows.members, n).array() += 1;
        });
    EXPECT_TRUE((seen.array() == 1).all()) << members << " x " << lines;
  }
}

}  // namespace stageid::test_line_sums
