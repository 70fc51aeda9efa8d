#include <algorithm>
#include <cmath>
#include <complex>

#include "estimation/uncertainty/data_noise.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kTileEntries = 1 << 15;  // of the columns of all channels

/// 1 / sqrt(C(a, a)), 0 if it is not positive, n x lines. @param columns vec of C, n x n, per line
Eigen::MatrixXd inverse_deviations(const Eigen::MatrixXcd& columns, Eigen::Index n) {
  return columns(Eigen::seqN(0, n, n + 1), Eigen::all).unaryExpr([](const std::complex<double>& c) {
    return c.real() > 0.0 ? 1.0 / std::sqrt(c.real()) : 0.0;
  });
}

/// C(a, b) / sqrt(C(a, a) C(b, b)), 0 if undefined; 1 for a = b.
std::complex<double> correlation_of(const Eigen::MatrixXcd& columns,
                                    const Eigen::MatrixXd& of_deviation, Eigen::Index a,
                                    Eigen::Index b, Eigen::Index line) {
  if (a == b) return 1.0;
  return columns(a + of_deviation.rows() * b, line) * of_deviation(a, line) * of_deviation(b, line);
}

/// The numbers without gaps between them. @param sorted without repetition
std::vector<DataRange> runs_of(const std::vector<Eigen::Index>& sorted) {
  std::vector<DataRange> runs;
  for (const Eigen::Index i : sorted) {
    if (runs.empty() || i != runs.back().first + runs.back().count) runs.push_back({i, 0});
    ++runs.back().count;
  }
  return runs;
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
        K_(X_.size()) {
    for (const std::vector<Eigen::Index>& parameters : inputs.parameters)
      runs_.push_back(runs_of(parameters));
  }

  void add(DataRange lines) {
    R_.clear();
    S_.clear();
    for (Eigen::Index i = lines.first; i < lines.first + lines.count; ++i) {
      R_.push_back(correlation_.of_outputs(i));
      if (correlation_.between_inputs()) S_.push_back(correlation_.of_inputs(i));
    }
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

  void read(int u, DataRange lines) {
    const Eigen::Index n_y = problem_.n_outputs;
    OutputColumns& X = X_[u];
    X.resize(2 * n_y * lines.count, std::ssize(inputs_.parameters[u]));
    for (Eigen::Index y = 0; y < n_y; ++y) {
      const SplitMatrix of_output = inputs_.columns(u, y, lines);
      X(Eigen::seqN(y, lines.count, 2 * n_y), Eigen::all) = of_output.re;
      X(Eigen::seqN(n_y + y, lines.count, 2 * n_y), Eigen::all) = of_output.im;
    }
    OutputColumns& Y = Y_[u];
    Y.resizeLike(X);
    for (Eigen::Index i = 0; i < lines.count; ++i)
      Y.middleRows(2 * n_y * i, 2 * n_y).noalias() = R_[i] * X.middleRows(2 * n_y * i, 2 * n_y);
  }

  OutputColumns with_other_inputs(int u, DataRange lines) const {
    const Eigen::Index n_y = problem_.n_outputs;
    OutputColumns Z = OutputColumns::Zero(2 * n_y * lines.count, n_);
    for (Eigen::Index i = 0; i < lines.count; ++i)
      for (std::size_t v = 0; v < Y_.size(); ++v) {
        const std::complex<double> s = S_[i](u, static_cast<Eigen::Index>(v));
        const auto re = Y_[v].middleRows(2 * n_y * i, n_y);
        const auto im = Y_[v].middleRows(2 * n_y * i + n_y, n_y);
        Eigen::Index first = 0;
        for (const DataRange to : runs_[v]) {
          const auto Y_re = re.middleCols(first, to.count);
          const auto Y_im = im.middleCols(first, to.count);
          Z.block(2 * n_y * i, to.first, n_y, to.count) += s.real() * Y_re - s.imag() * Y_im;
          Z.block(2 * n_y * i + n_y, to.first, n_y, to.count) += s.real() * Y_im + s.imag() * Y_re;
          first += to.count;
        }
      }
    return Z;
  }

  void multiply(int u, DataRange lines) {
    OutputColumns together;
    if (correlation_.between_inputs()) together = with_other_inputs(u, lines);
    const OutputColumns& Z = together.size() > 0 ? together : Y_[u];
    Eigen::MatrixXd& K = K_[u];
    if (K.size() == 0) K.setZero(X_[u].cols(), Z.cols());
    K.noalias() += X_[u].transpose() * Z;
    if (inputs_.use) inputs_.use(u, lines, Z);
  }

  const FitProblem& problem_;
  const NoiseCorrelation& correlation_;
  Eigen::Index n_;
  const CorrelatedColumns& inputs_;
  std::vector<std::vector<DataRange>> runs_;  ///< of the parameters of each input
  std::vector<Eigen::MatrixXd> R_;            ///< per line of the tile
  std::vector<Eigen::MatrixXcd> S_;
  std::vector<OutputColumns> X_;
  std::vector<OutputColumns> Y_;
  std::vector<Eigen::MatrixXd> K_;
};

}  // namespace

SplitMatrix columns_of_output(const OutputColumns& columns, Eigen::Index y, Eigen::Index n_y) {
  const Eigen::Index lines = columns.rows() / (2 * n_y);
  return {columns(Eigen::seqN(y, lines, 2 * n_y), Eigen::all),
          columns(Eigen::seqN(n_y + y, lines, 2 * n_y), Eigen::all)};
}

NoiseCorrelation::NoiseCorrelation(const FrfEstimate& frf) : frf_(&frf) {
  if (known()) of_deviation_y_ = inverse_deviations(frf.residual_covariance, frf.n_outputs());
  if (between_inputs()) of_deviation_u_ = inverse_deviations(frf.input_factor, frf.n_inputs());
}

std::complex<double> NoiseCorrelation::R(Eigen::Index y, Eigen::Index z, Eigen::Index line) const {
  return correlation_of(frf_->residual_covariance, of_deviation_y_, y, z, line);
}

std::complex<double> NoiseCorrelation::S(Eigen::Index u, Eigen::Index v, Eigen::Index line) const {
  return correlation_of(frf_->input_factor, of_deviation_u_, u, v, line);
}

Eigen::MatrixXd NoiseCorrelation::of_outputs(Eigen::Index line) const {
  const Eigen::Index n_y = frf_->n_outputs();
  const Eigen::MatrixXcd C = Eigen::MatrixXcd::NullaryExpr(
      n_y, n_y, [&](Eigen::Index y, Eigen::Index z) { return R(y, z, line); });
  Eigen::MatrixXd split(2 * n_y, 2 * n_y);
  split << C.real(), -C.imag(), C.imag(), C.real();
  return split;
}

Eigen::MatrixXcd NoiseCorrelation::of_inputs(Eigen::Index line) const {
  const Eigen::Index n_u = frf_->n_inputs();
  return Eigen::MatrixXcd::NullaryExpr(
      n_u, n_u, [&](Eigen::Index u, Eigen::Index v) { return S(u, v, line); });
}

SplitMatrix NoiseCorrelation::of_channels(Eigen::Index c, Eigen::Index d, DataRange lines) const {
  const Eigen::Index n_y = frf_->n_outputs();
  const Eigen::Index u = c / n_y;
  const Eigen::Index v = d / n_y;
  if (u != v && !between_inputs()) return {};
  SplitMatrix out{Eigen::MatrixXd(lines.count, 1), Eigen::MatrixXd(lines.count, 1)};
  for (Eigen::Index i = 0; i < lines.count; ++i) {
    const Eigen::Index line = lines.first + i;
    const std::complex<double> rho = R(c % n_y, d % n_y, line) * (u == v ? 1.0 : S(u, v, line));
    out.re(i, 0) = rho.real();
    out.im(i, 0) = rho.imag();
  }
  return out;
}

Eigen::MatrixXd correlated_gram(const FitProblem& problem, const NoiseCorrelation& correlation,
                                Eigen::Index n, const CorrelatedColumns& inputs) {
  GramOfTiles gram(problem, correlation, n, inputs);
  const auto channels = std::ssize(inputs.parameters) * problem.n_outputs;
  const Eigen::Index most =
      std::max<Eigen::Index>(8, kTileEntries / std::max<Eigen::Index>(1, n * channels));
  for (const DataRange lines : ranges_of(problem.size(), most)) gram.add(lines);
  return gram.sum();
}

}  // namespace stageid
