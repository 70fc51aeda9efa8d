#include "frf/skew_check.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr int kBlocks = 20;
constexpr int kIterations = 4;
constexpr std::size_t kFewestLines = 100;
constexpr std::size_t kMostModes = 8;
constexpr double kDeviations = 4.5;
constexpr double kDampingLeft = 0.02;  // of |G|, far from the resonances
constexpr double kLeastSkew_s = 5e-6;
constexpr double kUselessDeviation_s = 3e-6;

/// Lines on which omega^2 |G| has a maximum.
std::vector<std::size_t> resonances(const std::vector<PlantLine>& lines) {
  std::vector<std::size_t> found;
  const auto size = [&](std::size_t k) {
    return std::pow(lines[k].omega_rad_s, 2) * lines[k].G.norm();
  };
  for (std::size_t k = 1; k + 1 < lines.size(); ++k)
    if (size(k) > size(k - 1) && size(k) >= size(k + 1)) found.push_back(k);
  return found;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Normal equations of one block of lines.
struct Normal {
  Eigen::MatrixXd M;
  Eigen::VectorXd v;
};

class SkewFit {
 public:
  explicit SkewFit(const std::vector<PlantLine>& lines)
      : lines_(lines), n_y_(lines.front().G.rows()), n_u_(lines.front().G.cols()) {
    const std::size_t most = std::min(kMostModes, static_cast<std::size_t>(n_y_ * n_u_ / 4));
    for (const std::size_t k : resonances(lines)) peaks_.push_back(k);
    modes_ = std::min(most, peaks_.size());
  }

  /// Skews [tau; sigma] in s, each against the median of its kind.
  Eigen::VectorXd solve();
  Eigen::VectorXd deviations() const;

 private:
  void accumulate(const Eigen::VectorXd& skew);
  Eigen::MatrixXd damping_directions(std::size_t line, const Eigen::VectorXd& skew) const;
  Eigen::MatrixXcd turned(std::size_t line, const Eigen::VectorXd& skew) const;
  /// Each kind against its median: what all sensors or all actuators share is the plant's delay, and
  /// what damping adds to all of them alike.
  Eigen::VectorXd relative(Eigen::VectorXd skew) const {
    skew.head(n_y_).array() -= median({skew.data(), skew.data() + n_y_});
    skew.tail(n_u_).array() -= median({skew.data() + n_y_, skew.data() + n_y_ + n_u_});
    return skew;
  }
  static Eigen::VectorXd solution(const Normal& normal) {
    return normal.M.completeOrthogonalDecomposition().solve(normal.v);
  }

  const std::vector<PlantLine>& lines_;
  Index n_y_;
  Index n_u_;
  std::vector<std::size_t> peaks_;
  std::size_t modes_ = 0;
  std::vector<Normal> blocks_;
  Eigen::VectorXd skew_;
};

/// G with the skews found so far undone.
Eigen::MatrixXcd SkewFit::turned(std::size_t k, const Eigen::VectorXd& skew) const {
  const auto phases = [&](const Eigen::VectorXd& delays_s) {
    Eigen::VectorXcd turn(delays_s.size());
    for (Index i = 0; i < turn.size(); ++i)
      turn[i] = std::polar(1.0, lines_[k].omega_rad_s * delays_s[i]);
    return turn;
  };
  return phases(skew.head(n_y_)).asDiagonal() * lines_[k].G * phases(skew.tail(n_u_)).asDiagonal();
}

/// Orthonormal basis of Im vec G at the resonances that are nearest to the line.
Eigen::MatrixXd SkewFit::damping_directions(std::size_t k, const Eigen::VectorXd& skew) const {
  std::vector<std::size_t> nearest = peaks_;
  const auto distance = [&](std::size_t p) {
    return std::abs(std::log(lines_[p].omega_rad_s / lines_[k].omega_rad_s));
  };
  std::sort(nearest.begin(), nearest.end(),
            [&](auto a, auto b) { return distance(a) < distance(b); });
  Eigen::MatrixXd directions(n_y_ * n_u_, static_cast<Index>(modes_));
  for (std::size_t m = 0; m < modes_; ++m)
    directions.col(static_cast<Index>(m)) = turned(nearest[m], skew).imag().reshaped().normalized();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(directions);
  return qr.householderQ() * Eigen::MatrixXd::Identity(directions.rows(), qr.rank());
}

void SkewFit::accumulate(const Eigen::VectorXd& skew) {
  const Index n = n_y_ + n_u_;
  blocks_.assign(kBlocks, {Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)});
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    Eigen::MatrixXcd G = turned(k, skew);
    // Equal weight a line, but where noise is more than what damping leaves.
    const double noise = lines_[k].variance.sum() / G.squaredNorm();
    G /= G.norm() * std::sqrt(1.0 + noise / (kDampingLeft * kDampingLeft));
    const double omega = lines_[k].omega_rad_s;
    Eigen::MatrixXd X = Eigen::MatrixXd::Zero(n_y_ * n_u_, n);
    for (Index j = 0; j < n_u_; ++j)
      for (Index i = 0; i < n_y_; ++i)
        X(i + n_y_ * j, i) = X(i + n_y_ * j, n_y_ + j) = -omega * G(i, j).real();
    Eigen::VectorXd rest = G.imag().reshaped();
    const Eigen::MatrixXd Q = damping_directions(k, skew);
    X -= Q * (Q.transpose() * X);
    rest -= Q * (Q.transpose() * rest);
    Normal& block = blocks_[k * kBlocks / lines_.size()];
    block.M += X.transpose() * X;
    block.v += X.transpose() * rest;
  }
}

Eigen::VectorXd SkewFit::solve() {
  Eigen::VectorXd skew = Eigen::VectorXd::Zero(n_y_ + n_u_);
  for (int i = 0; i < kIterations; ++i) {
    accumulate(skew);
    Normal sum = blocks_.front();
    for (std::size_t b = 1; b < blocks_.size(); ++b) {
      sum.M += blocks_[b].M;
      sum.v += blocks_[b].v;
    }
    skew += solution(sum);
  }
  skew_ = skew;
  return relative(skew);
}

/// @pre solve() was called.
Eigen::VectorXd SkewFit::deviations() const {
  Eigen::MatrixXd left_out(n_y_ + n_u_, kBlocks);
  for (std::size_t out = 0; out < blocks_.size(); ++out) {
    Normal sum{Eigen::MatrixXd::Zero(n_y_ + n_u_, n_y_ + n_u_), Eigen::VectorXd::Zero(n_y_ + n_u_)};
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      if (b == out) continue;
      sum.M += blocks_[b].M;
      sum.v += blocks_[b].v;
    }
    left_out.col(static_cast<Index>(out)) = relative(skew_ + solution(sum));
  }
  const Eigen::VectorXd mean = left_out.rowwise().mean();
  const Eigen::VectorXd squares = (left_out.colwise() - mean).rowwise().squaredNorm();
  return (squares * ((kBlocks - 1.0) / kBlocks)).cwiseSqrt();
}

}  // namespace

SkewCheck check_skew(const std::vector<PlantLine>& lines, const std::vector<Index>& outputs,
                     const std::vector<Index>& inputs) {
  SkewCheck check;
  const auto n_y = static_cast<Index>(outputs.size());
  const auto n_u = static_cast<Index>(inputs.size());
  if (lines.size() < kFewestLines || n_y < 3 || n_u < 3) {
    check.unchecked = "100 excited lines, three sensors and three actuators";
    return check;
  }
  SkewFit fit(lines);
  const Eigen::VectorXd skew = fit.solve();
  const Eigen::VectorXd deviation = fit.deviations();
  check.largest_deviation_s = deviation.maxCoeff();
  const auto look = [&](bool of_sensors, const std::vector<Index>& channels, Index first) {
    const auto n = static_cast<Index>(channels.size());
    for (Index i = 0; i < n; ++i) {
      const double late = skew[first + i];
      if (std::abs(late) < std::max(kLeastSkew_s, kDeviations * deviation[first + i])) continue;
      check.changes.push_back({ChannelChange::Kind::skew, of_sensors,
                               channels[static_cast<std::size_t>(i)], -1, late,
                               deviation[first + i]});
    }
  };
  look(true, outputs, 0);
  look(false, inputs, n_y);
  if (check.changes.empty() && check.largest_deviation_s > kUselessDeviation_s)
    check.unchecked = "more power or lighter damping: 4.5 deviations are more than 13 us";
  return check;
}

}  // namespace stageid
