#include "estimation/modal/assignment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

namespace stageid::test_assignment {

using Pairs = std::vector<std::optional<Eigen::Index>>;

/// Unpaired rows and columns cost half the limit each, as in the definition.
double total(const Eigen::MatrixXd& cost, double limit, const Pairs& pairs) {
  double sum = 0.5 * limit * static_cast<double>(cost.rows() + cost.cols());
  for (std::size_t r = 0; r < pairs.size(); ++r)
    if (pairs[r]) sum += cost(static_cast<Eigen::Index>(r), *pairs[r]) - limit;
  return sum;
}

/// By trying every permutation of the longer side.
double least_total(const Eigen::MatrixXd& cost, double limit) {
  const Eigen::Index size = std::max(cost.rows(), cost.cols());
  std::vector<Eigen::Index> column(size);
  std::iota(column.begin(), column.end(), 0);
  double least = 1e300;
  do {
    Pairs pairs(static_cast<std::size_t>(cost.rows()));
    for (std::size_t r = 0; r < pairs.size(); ++r)
      if (column[r] < cost.cols() && cost(static_cast<Eigen::Index>(r), column[r]) < limit)
        pairs[r] = column[r];
    least = std::min(least, total(cost, limit, pairs));
  } while (std::next_permutation(column.begin(), column.end()));
  return least;
}

TEST(Assignment, CostsTheLeastOfAllPermutations) {
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<double> uniform(0.0, 10.0);
  for (Eigen::Index rows = 1; rows <= 6; ++rows)
    for (Eigen::Index columns = 1; columns <= 6; ++columns)
      for (int repetition = 0; repetition < 5; ++repetition) {
        const Eigen::MatrixXd cost =
            Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return uniform(engine); });
        const Pairs pairs = least_cost_pairs(cost, 4.0);
        EXPECT_NEAR(total(cost, 4.0, pairs), least_total(cost, 4.0), 1e-12) << cost;
      }
}

TEST(Assignment, GivesUpTheBestPairWhereTheSumRequiresItAndPairsNothingAtTheLimit) {
  const Eigen::MatrixXd cost{{1.0, 2.0}, {2.0, 9.0}};
  EXPECT_EQ(least_cost_pairs(cost, 100.0), (Pairs{1, 0}));
  EXPECT_EQ(least_cost_pairs(Eigen::MatrixXd{{5.0}, {4.9}}, 5.0), (Pairs{std::nullopt, 0}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(least_cost_pairs(Eigen::MatrixXd{{nan, 1.0}, {nan, nan}}, 5.0),
            (Pairs{1, std::nullopt}));
  EXPECT_EQ(least_cost_pairs(Eigen::MatrixXd(2, 0), 5.0), Pairs(2));
  EXPECT_EQ(least_cost_pairs(Eigen::MatrixXd(0, 2), 5.0), Pairs{});
}

}  // namespace stageid::test_assignment
