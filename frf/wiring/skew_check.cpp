#include "frf/wiring/skew_check.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <span>

#include "excitation/decompositions/decompositions.hpp"
#include "frf/statistics/order_statistic.hpp"
#include "frf/wiring/connected_blocks.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr int kBlocks = 20;
constexpr int kIterations = 6;
constexpr std::size_t kFewestSkewLines = 100;
constexpr Index kFewestChannels = 3;  // per kind: with two, the late one cannot be identified
constexpr double kSkewDeviations = 8.0;
constexpr double kNear = 0.3;            // ln of the frequency ratio of lines with the same modes
constexpr double kLeastDirection = 0.1;  // Im G outside the directions taken already, of |G|
constexpr double kNoiseAllowed = 0.02;   // of |G|: above it, a line's weight decreases
constexpr double kLeastSkew_s = 5e-6;
constexpr double kWantedSkew_s = 10e-6;

/// Normal equations M x = v, and the squared norm of the data.
struct Normal {
  Eigen::MatrixXd M;
  Eigen::VectorXd v;
  double square = 0.0;

  explicit Normal(Index n) : M(Eigen::MatrixXd::Zero(n, n)), v(Eigen::VectorXd::Zero(n)) {}
  void add(const Normal& other, double weight) {
    M += weight * other.M;
    v += weight * other.v;
    square += weight * other.square;
  }
  Eigen::VectorXd solution() const { return shortest_least_squares(M, v); }
  double residual(const Eigen::VectorXd& x) const {
    return std::max(0.0, square - 2.0 * x.dot(v) + x.dot(M * x));
  }
};

class SkewFit {
 public:
  explicit SkewFit(const std::vector<PlantLine>& lines)
      : lines_(lines),
        n_y_(lines.front().G.rows()),
        n_u_(lines.front().G.cols()),
        trust_(Eigen::VectorXd::Ones(std::ssize(lines))),
        blocks_(kBlocks, Normal(n_y_ + n_u_)),
        skew_(Eigen::VectorXd::Zero(n_y_ + n_u_)) {}

  /// Skews [tau; sigma] in s, each relative to the median of its kind.
  Eigen::VectorXd solve() {
    for (int i = 0; i < kIterations; ++i) iterate();
    return relative(skew_);
  }

  /// @pre solve() was called.
  Eigen::VectorXd deviations() const {
    Eigen::MatrixXd left_out(n_y_ + n_u_, kBlocks);
    for (std::size_t out = 0; out < blocks_.size(); ++out) {
      Normal sum(n_y_ + n_u_);
      for (std::size_t b = 0; b < blocks_.size(); ++b)
        if (b != out) sum.add(blocks_[b], 1.0);
      left_out.col(out) = relative(skew_ + sum.solution());
    }
    const Eigen::VectorXd mean = left_out.rowwise().mean();
    const Eigen::VectorXd squares = (left_out.colwise() - mean).rowwise().squaredNorm();
    return (squares * ((kBlocks - 1.0) / kBlocks)).cwiseSqrt();
  }

 private:
  void iterate() {
    const auto K = std::ssize(lines_);
    std::vector<Eigen::MatrixXcd> G;
    Eigen::MatrixXd imaginary(n_y_ * n_u_, K);
    for (const PlantLine& line : lines_) {
      G.push_back(turned(line));
      const Eigen::MatrixXd of_line = G.back().imag();
      imaginary.col(std::ssize(G) - 1) = of_line.reshaped();
    }
    std::vector<Normal> normals;
    Normal sum(n_y_ + n_u_);
    for (Index b = 0; b < kBlocks; ++b) {
      const Eigen::MatrixXd Q = damping_directions(imaginary, b);
      Normal& block = blocks_[b] = Normal(n_y_ + n_u_);
      for (Index k = first_of(b); k < first_of(b + 1); ++k) {
        normals.push_back(normal_of(k, G[k], Q));
        block.add(normals.back(), trust_[k]);
      }
      sum.add(block, 1.0);
    }
    const Eigen::VectorXd step = sum.solution();
    skew_ += step;
    std::vector<double> residuals;  // by line
    for (const Normal& normal : normals) residuals.push_back(normal.residual(step));
    std::vector<double> sorted = residuals;
    const double middle = std::max(1e-300, median(sorted));
    for (Index k = 0; k < K; ++k) trust_[k] = 1.0 / (1.0 + residuals[k] / middle);
  }

  /// G with the skews found so far undone, normalized; reduced if noise dominates.
  Eigen::MatrixXcd turned(const PlantLine& line) const {
    const auto phases = [&](const Eigen::VectorXd& delays_s) {
      Eigen::VectorXcd turn(delays_s.size());
      for (Index i = 0; i < turn.size(); ++i)
        turn[i] = std::polar(1.0, line.omega_rad_s * delays_s[i]);
      return turn;
    };
    const double size = std::sqrt(std::max(
        1e-300, line.G.squaredNorm() + line.variance.sum() / (kNoiseAllowed * kNoiseAllowed)));
    return phases(skew_.head(n_y_)).asDiagonal() * (line.G / size) *
           phases(skew_.tail(n_u_)).asDiagonal();
  }

  /// Orthonormal basis of the contribution of damping near a block. Pivoted QR takes the line with the largest Im vec G
  /// first, a resonance, then the one with the largest remaining part, and so on. Lines are weighted by their distance
  /// from the block, and half of the entries are reserved for the skews.
  Eigen::MatrixXd damping_directions(const Eigen::MatrixXd& imaginary, Index block) const {
    const auto log_omega = [&](Index k) { return std::log(lines_[k].omega_rad_s); };
    double middle = 0.0;
    const Index first = first_of(block);
    const Index last = first_of(block + 1);
    for (Index k = first; k < last; ++k) middle += log_omega(k) / static_cast<double>(last - first);
    Eigen::MatrixXd near = imaginary;
    for (Index k = 0; k < near.cols(); ++k) {
      const double distance = (log_omega(k) - middle) / kNear;
      near.col(k) /= 1.0 + distance * distance;
    }
    const auto qr = pivoted_qr(near);
    Index rank = 0;
    while (rank < imaginary.rows() / 2 && std::abs(qr.matrixQR()(rank, rank)) > kLeastDirection)
      ++rank;
    return leading_columns(qr, rank);
  }

  /// @param Q directions to project off
  Normal normal_of(std::size_t k, const Eigen::MatrixXcd& G, const Eigen::MatrixXd& Q) const {
    Eigen::MatrixXd X = Eigen::MatrixXd::Zero(n_y_ * n_u_, n_y_ + n_u_);
    for (Index j = 0; j < n_u_; ++j)
      for (Index i = 0; i < n_y_; ++i)
        X(i + n_y_ * j, i) = X(i + n_y_ * j, n_y_ + j) = -lines_[k].omega_rad_s * G(i, j).real();
    const Eigen::MatrixXd imaginary = G.imag();
    Eigen::VectorXd rest = imaginary.reshaped();
    X -= Q * (Q.transpose() * X);
    rest -= Q * (Q.transpose() * rest);
    Normal normal(n_y_ + n_u_);
    normal.M = X.transpose() * X;
    normal.v = X.transpose() * rest;
    normal.square = rest.squaredNorm();
    return normal;
  }

  Index first_of(Index block) const { return block * std::ssize(lines_) / kBlocks; }
  /// Subtracts the median of each kind: the common delay of all sensors or all actuators belongs to the plant, and
  /// damping adds to it.
  Eigen::VectorXd relative(Eigen::VectorXd skew) const {
    std::vector<double> values(skew.begin(), skew.end());
    const std::span all(values);
    skew.head(n_y_).array() -= median(all.first(n_y_));
    skew.tail(n_u_).array() -= median(all.last(static_cast<std::size_t>(n_u_)));
    return skew;
  }

  const std::vector<PlantLine>& lines_;
  Index n_y_;
  Index n_u_;
  Eigen::VectorXd trust_;  // of each line
  std::vector<Normal> blocks_;
  Eigen::VectorXd skew_;
};

}  // namespace

SkewCheck check_skew(const std::vector<PlantLine>& lines, const std::vector<Index>& outputs,
                     const std::vector<Index>& inputs) {
  SkewCheck check;
  bool any = false;
  bool all = true;
  for (const ConnectedBlock& block : connected_blocks(lines)) {
    const auto n_y = std::ssize(block.outputs);
    const auto n_u = std::ssize(block.inputs);
    if (lines.size() < kFewestSkewLines || n_y < kFewestChannels || n_u < kFewestChannels) {
      all = false;
      continue;
    }
    any = true;
    SkewFit fit(block.lines);
    const Eigen::VectorXd skew = fit.solve();
    const Eigen::VectorXd deviation = fit.deviations();
    check.largest_deviation_s = std::max(check.largest_deviation_s, deviation.maxCoeff());
    for (Index i = 0; i < n_y + n_u; ++i) {
      if (!(std::abs(skew[i]) >= std::max(kLeastSkew_s, kSkewDeviations * deviation[i]))) continue;
      const bool of_sensors = i < n_y;
      const Index in_log = of_sensors ? outputs[block.outputs[i]] : inputs[block.inputs[i - n_y]];
      check.errors.push_back(
          {ChannelError::Kind::skew, of_sensors, in_log, -1, skew[i], deviation[i]});
    }
  }
  if (!any)
    check.unchecked =
        "100 excited lines, and three sensors and three actuators that respond to each other "
        "above the noise";
  else if (check.errors.empty() && kSkewDeviations * check.largest_deviation_s > kWantedSkew_s)
    check.unchecked =
        fmt::format("more power or lighter damping ({:.0f} standard deviations are {:.3g} us)",
                    kSkewDeviations, 1e6 * kSkewDeviations * check.largest_deviation_s);
  else if (!all)
    check.unchecked = "three sensors and three actuators in each decoupled part";
  return check;
}

}  // namespace stageid
