#include <algorithm>
#include <cmath>
#include <complex>

#include "estimation/uncertainty/data_noise.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kTileEntries = 1 << 17;  // of the columns of all channels

/// C(a, b) / sqrt(C(a, a) C(b, b)) on some lines, 0 if undefined; 1 for a = b. @param columns vec of C, n x n, per line
SplitMatrix correlation_of(const Eigen::MatrixXcd& columns, Eigen::Index n, Eigen::Index a,
                           Eigen::Index b, IndexRange lines) {
  SplitMatrix out{Eigen::MatrixXd::Ones(lines.count, 1), Eigen::MatrixXd::Zero(lines.count, 1)};
  for (Eigen::Index i = 0; a != b && i < lines.count; ++i) {
    const auto C = columns.col(lines.first + i).reshaped(n, n);
    const double power = C(a, a).real() * C(b, b).real();
    const std::complex<double> rho = power > 0.0 ? C(a, b) / std::sqrt(power) : 0.0;
    out.re(i, 0) = rho.real();
    out.im(i, 0) = rho.imag();
  }
  return out;
}

/// Column `to` += factor times column `from`, line by line.
void add_scaled(const SplitMatrix& factor, const SplitMatrix& X, Eigen::Index from, SplitMatrix& Y,
                Eigen::Index to) {
  const auto re = factor.re.col(0).array();
  const auto im = factor.im.col(0).array();
  Y.re.col(to).array() += re * X.re.col(from).array() - im * X.im.col(from).array();
  Y.im.col(to).array() += re * X.im.col(from).array() + im * X.re.col(from).array();
}

/// Correlated grams of the inputs, one tile of lines after another.
class GramOfTiles {
 public:
  GramOfTiles(const FitProblem& problem, const NoiseCorrelation& correlation, Eigen::Index n,
              const CorrelatedColumns& inputs)
      : problem_(problem),
        correlation_(correlation),
        n_(n),
        inputs_(inputs),
        X_(inputs.parameters.size()),
        Y_(X_.size()),
        K_(X_.size()) {}

  void add(IndexRange lines) {
    const auto count = static_cast<int>(X_.size());
    for_each_task(problem_.threads, count, [&](int u) { read(u, lines); });
    for_each_task(problem_.threads, count, [&](int u) { multiply(u, lines); });
  }

  Eigen::MatrixXd sum() const {
    Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n_, n_);
    for (std::size_t u = 0; u < K_.size(); ++u)
      if (K_[u].size() > 0) K(inputs_.parameters[u], columns_of(u)) += K_[u];
    return 0.5 * (K + K.transpose());
  }

 private:
  /// The parameters of the columns of (S kron R) X.
  std::vector<Eigen::Index> columns_of(std::size_t u) const {
    return correlation_.between_inputs() ? indices(0, n_) : inputs_.parameters[u];
  }

  void read(int u, IndexRange lines) {
    OutputColumns& X = X_[u];
    X.resize(problem_.n_outputs);
    for (std::size_t y = 0; y < X.size(); ++y)
      X[y] = inputs_.columns(u, static_cast<Eigen::Index>(y), lines);
    Y_[u] = correlation_.of_outputs(X, lines);
  }

  OutputColumns with_other_inputs(int u, IndexRange lines) const {
    OutputColumns Z(static_cast<std::size_t>(problem_.n_outputs));
    for (SplitMatrix& of_output : Z) of_output.set_zero(lines.count, n_);
    for (std::size_t v = 0; v < Y_.size(); ++v)
      correlation_.add_input(inputs_.first_input + u,
                             inputs_.first_input + static_cast<Eigen::Index>(v), Y_[v],
                             inputs_.parameters[v], lines, Z);
    return Z;
  }

  void multiply(int u, IndexRange lines) {
    const OutputColumns& X = X_[u];
    OutputColumns together;
    if (correlation_.between_inputs()) together = with_other_inputs(u, lines);
    const OutputColumns& Z = together.empty() ? Y_[u] : together;
    Eigen::MatrixXd& K = K_[u];
    if (K.size() == 0) K.setZero(X.front().cols(), Z.front().cols());
    for (std::size_t y = 0; y < Z.size(); ++y) {
      K.noalias() += X[y].re.transpose() * Z[y].re;
      K.noalias() += X[y].im.transpose() * Z[y].im;
    }
    if (inputs_.use) inputs_.use(u, lines, Z);
  }

  const FitProblem& problem_;
  const NoiseCorrelation& correlation_;
  Eigen::Index n_;
  const CorrelatedColumns& inputs_;
  std::vector<OutputColumns> X_;
  std::vector<OutputColumns> Y_;
  std::vector<Eigen::MatrixXd> K_;
};

}  // namespace

SplitMatrix NoiseCorrelation::R(Eigen::Index y, Eigen::Index z, IndexRange lines) const {
  return correlation_of(frf_->residual_covariance, frf_->n_outputs(), y, z, lines);
}

SplitMatrix NoiseCorrelation::S(Eigen::Index u, Eigen::Index v, IndexRange lines) const {
  return correlation_of(frf_->input_factor, frf_->n_inputs(), u, v, lines);
}

OutputColumns NoiseCorrelation::of_outputs(const OutputColumns& X, IndexRange lines) const {
  OutputColumns Y = X;  // the diagonal of R is one
  const Eigen::Index n_y = frf_->n_outputs();
  for (Eigen::Index y = 0; y < n_y; ++y)
    for (Eigen::Index z = 0; z < n_y; ++z) {
      if (z == y) continue;
      const SplitMatrix rho = R(y, z, lines);
      const SplitMatrix& from = X[z];
      for (Eigen::Index p = 0; p < from.cols(); ++p) add_scaled(rho, from, p, Y[y], p);
    }
  return Y;
}

void NoiseCorrelation::add_input(Eigen::Index u, Eigen::Index v, const OutputColumns& Y,
                                 const std::vector<Eigen::Index>& at, IndexRange lines,
                                 OutputColumns& Z) const {
  const SplitMatrix rho = S(u, v, lines);
  for (std::size_t y = 0; y < Y.size(); ++y)
    for (std::size_t p = 0; p < at.size(); ++p)
      add_scaled(rho, Y[y], static_cast<Eigen::Index>(p), Z[y], at[p]);
}

SplitMatrix NoiseCorrelation::of_channels(Eigen::Index c, Eigen::Index d, IndexRange lines) const {
  const Eigen::Index n_y = frf_->n_outputs();
  const Eigen::Index u = c / n_y;
  const Eigen::Index v = d / n_y;
  if (u != v && !between_inputs()) return {};
  SplitMatrix of_outputs = R(c % n_y, d % n_y, lines);
  if (u == v) return of_outputs;
  const auto& [re, im] = of_outputs;
  const SplitMatrix of_inputs = S(u, v, lines);
  return {re.cwiseProduct(of_inputs.re) - im.cwiseProduct(of_inputs.im),
          re.cwiseProduct(of_inputs.im) + im.cwiseProduct(of_inputs.re)};
}

Eigen::MatrixXd correlated_gram(const FitProblem& problem, const NoiseCorrelation& correlation,
                                Eigen::Index n, const CorrelatedColumns& inputs) {
  GramOfTiles gram(problem, correlation, n, inputs);
  const auto channels = std::ssize(inputs.parameters) * problem.n_outputs;
  const Eigen::Index most =
      std::max<Eigen::Index>(8, kTileEntries / std::max<Eigen::Index>(1, n * channels));
  for (const IndexRange lines : ranges_of(problem.size(), most)) gram.add(lines);
  return gram.sum();
}

}  // namespace stageid
