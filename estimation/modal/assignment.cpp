#include "estimation/modal/assignment.hpp"

#include <limits>

namespace stageid {
namespace {

/// Extends the pairs by one row, along the cheapest path of exchanges. All arrays have a leading entry 0: in
/// `row_of`, the new row.
class Augmentation {
 public:
  explicit Augmentation(const Eigen::MatrixXd& cost)
      : cost_(cost),
        row_price_(Eigen::VectorXd::Zero(cost.rows() + 1)),
        column_price_(Eigen::VectorXd::Zero(cost.cols() + 1)),
        row_of(static_cast<std::size_t>(cost.cols() + 1), 0) {}

  void add(Eigen::Index row) {
    const Eigen::Index columns = cost_.cols();
    const double infinity = std::numeric_limits<double>::infinity();
    Eigen::VectorXd slack = Eigen::VectorXd::Constant(columns + 1, infinity);
    std::vector<Eigen::Index> before(row_of.size(), 0);
    std::vector<bool> visited(row_of.size(), false);
    row_of[0] = row;
    Eigen::Index at = 0;
    while (row_of[at] != 0) {
      visited[at] = true;
      const Eigen::Index from = row_of[at];
      Eigen::Index next = 0;
      double least = infinity;
      for (Eigen::Index c = 1; c <= columns; ++c) {
        if (visited[c]) continue;
        const double reduced = cost_(from - 1, c - 1) - row_price_[from] - column_price_[c];
        if (reduced < slack[c]) {
          slack[c] = reduced;
          before[c] = at;
        }
        if (slack[c] < least) {
          least = slack[c];
          next = c;
        }
      }
      for (Eigen::Index c = 0; c <= columns; ++c) {
        if (visited[c]) {
          row_price_[row_of[c]] += least;
          column_price_[c] -= least;
        } else {
          slack[c] -= least;
        }
      }
      at = next;
    }
    for (; at != 0; at = before[at]) row_of[at] = row_of[before[at]];
  }

 private:
  const Eigen::MatrixXd& cost_;
  Eigen::VectorXd row_price_;
  Eigen::VectorXd column_price_;

 public:
  std::vector<Eigen::Index> row_of;  ///< per column, 1-based; 0: none
};

}  // namespace

std::vector<std::optional<Eigen::Index>> least_cost_pairs(const Eigen::MatrixXd& cost,
                                                          double limit) {
  std::vector<std::optional<Eigen::Index>> column_of(cost.rows());
  if (cost.size() == 0) return column_of;
  // Pairs at the limit mean "unpaired", so every row can be paired; rows are the shorter side.
  const bool turned = cost.rows() > cost.cols();
  const Eigen::MatrixXd sided = turned ? Eigen::MatrixXd(cost.transpose()) : cost;
  const Eigen::MatrixXd limited = (sided.array() < limit).select(sided, limit);  // NaN: the limit
  Augmentation pairs(limited);
  for (Eigen::Index row = 1; row <= limited.rows(); ++row) pairs.add(row);
  for (Eigen::Index c = 0; c < limited.cols(); ++c) {
    const Eigen::Index r = pairs.row_of[c + 1] - 1;
    if (r < 0 || limited(r, c) >= limit) continue;
    column_of[turned ? c : r] = turned ? r : c;
  }
  return column_of;
}

}  // namespace stageid
