#include "estimation/uncertainty/noise_correlation.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kTileEntries = 1 << 17;  // of the columns of all channels

/// C(a, b) / sqrt(C(a, a) C(b, b)) on some lines, 0 if undefined. @param C (a, b, line) -> complex
template <typename Covariance>
void correlation_of(const Covariance& C, Eigen::Index a, Eigen::Index b, LineRange lines,
                    Eigen::ArrayXd& re, Eigen::ArrayXd& im) {
  re.resize(lines.count);
  im.resize(lines.count);
  for (Eigen::Index i = 0; i < lines.count; ++i) {
    const Eigen::Index k = lines.first + i;
    const double power = C(a, a, k).real() * C(b, b, k).real();
    const std::complex<double> rho = power > 0.0 ? C(a, b, k) / std::sqrt(power) : 0.0;
    re[i] = rho.real();
    im[i] = rho.imag();
  }
}

/// to += (s_re + i s_im) from, line by line.
void add_scaled(const Eigen::ArrayXd& s_re, const Eigen::ArrayXd& s_im,
                const Eigen::MatrixXd& from_re, const Eigen::MatrixXd& from_im, Eigen::Index from,
                Eigen::MatrixXd& to_re, Eigen::MatrixXd& to_im, Eigen::Index to) {
  to_re.col(to).array() += s_re * from_re.col(from).array() - s_im * from_im.col(from).array();
  to_im.col(to).array() += s_re * from_im.col(from).array() + s_im * from_re.col(from).array();
}

OutputColumns zeros(Eigen::Index outputs, Eigen::Index lines, Eigen::Index n) {
  const std::vector<Eigen::MatrixXd> part(static_cast<std::size_t>(outputs),
                                          Eigen::MatrixXd::Zero(lines, n));
  return {part, part};
}

std::vector<Eigen::Index> all_of(Eigen::Index n) {
  std::vector<Eigen::Index> places(static_cast<std::size_t>(n));
  std::iota(places.begin(), places.end(), Eigen::Index{0});
  return places;
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

  void add(LineRange lines) {
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
    return correlation_.between_inputs() ? all_of(n_) : inputs_.parameters[u];
  }

  void read(int u, LineRange lines) {
    OutputColumns& X = X_[static_cast<std::size_t>(u)];
    X.re.resize(static_cast<std::size_t>(problem_.n_outputs));
    X.im.resize(X.re.size());
    for (std::size_t y = 0; y < X.re.size(); ++y)
      inputs_.columns(u, static_cast<Eigen::Index>(y), lines, X.re[y], X.im[y]);
    Y_[static_cast<std::size_t>(u)] = correlation_.of_outputs(X, lines);
  }

  OutputColumns with_other_inputs(int u, LineRange lines) const {
    OutputColumns Z = zeros(problem_.n_outputs, lines.count, n_);
    for (std::size_t v = 0; v < Y_.size(); ++v)
      correlation_.add_input(inputs_.first_input + u,
                             inputs_.first_input + static_cast<Eigen::Index>(v), Y_[v],
                             inputs_.parameters[v], lines, Z);
    return Z;
  }

  void multiply(int u, LineRange lines) {
    const auto input = static_cast<std::size_t>(u);
    if (correlation_.between_inputs())
      multiply(input, with_other_inputs(u, lines), lines);
    else
      multiply(input, Y_[input], lines);
  }

  void multiply(std::size_t u, const OutputColumns& Z, LineRange lines) {
    Eigen::MatrixXd& K = K_[u];
    if (K.size() == 0) K.setZero(X_[u].re.front().cols(), Z.re.front().cols());
    for (std::size_t y = 0; y < Z.re.size(); ++y) {
      K.noalias() += X_[u].re[y].transpose() * Z.re[y];
      K.noalias() += X_[u].im[y].transpose() * Z.im[y];
    }
    if (inputs_.use) inputs_.use(static_cast<Eigen::Index>(u), lines, Z);
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

NoiseCorrelation::NoiseCorrelation(const FrfEstimate& frf)
    : n_y_(frf.n_outputs()), n_u_(frf.n_inputs()) {
  if (frf.residual_covariance_re.size() == 0) return;
  re_ = &frf.residual_covariance_re;
  im_ = &frf.residual_covariance_im;
  if (frf.input_factor.size() > 0 && n_u_ > 1) S_ = &frf.input_factor;
}

OutputColumns NoiseCorrelation::of_outputs(const OutputColumns& X, LineRange lines) const {
  const auto C = [this](Eigen::Index y, Eigen::Index z, Eigen::Index k) {
    const Eigen::Index at = y + n_y_ * z;
    return std::complex<double>((*re_)(at, k), (*im_)(at, k));
  };
  OutputColumns Y = X;  // the diagonal of R is one
  Eigen::ArrayXd re;
  Eigen::ArrayXd im;
  for (Eigen::Index y = 0; y < n_y_; ++y)
    for (Eigen::Index z = 0; z < n_y_; ++z) {
      if (z == y) continue;
      const auto to = static_cast<std::size_t>(y);
      const auto from = static_cast<std::size_t>(z);
      correlation_of(C, y, z, lines, re, im);
      for (Eigen::Index p = 0; p < X.re[from].cols(); ++p)
        add_scaled(re, im, X.re[from], X.im[from], p, Y.re[to], Y.im[to], p);
    }
  return Y;
}

void NoiseCorrelation::add_input(Eigen::Index u, Eigen::Index v, const OutputColumns& Y,
                                 const std::vector<Eigen::Index>& at, LineRange lines,
                                 OutputColumns& Z) const {
  Eigen::ArrayXd re = Eigen::ArrayXd::Ones(lines.count);  // the diagonal of S is one
  Eigen::ArrayXd im = Eigen::ArrayXd::Zero(lines.count);
  const auto C = [this](Eigen::Index a, Eigen::Index b, Eigen::Index k) {
    return (*S_)(a + n_u_ * b, k);
  };
  if (u != v) correlation_of(C, u, v, lines, re, im);
  for (std::size_t y = 0; y < Y.re.size(); ++y)
    for (std::size_t p = 0; p < at.size(); ++p)
      add_scaled(re, im, Y.re[y], Y.im[y], static_cast<Eigen::Index>(p), Z.re[y], Z.im[y], at[p]);
}

bool NoiseCorrelation::of_channels(Eigen::Index c, Eigen::Index d, LineRange lines,
                                   Eigen::ArrayXd& re, Eigen::ArrayXd& im) const {
  const auto of_outputs = [this](Eigen::Index y, Eigen::Index z, Eigen::Index k) {
    const Eigen::Index at = y + n_y_ * z;
    return std::complex<double>((*re_)(at, k), (*im_)(at, k));
  };
  const auto of_inputs = [this](Eigen::Index u, Eigen::Index v, Eigen::Index k) {
    return (*S_)(u + n_u_ * v, k);
  };
  const Eigen::Index u = c / n_y_;
  const Eigen::Index v = d / n_y_;
  if (u != v && !between_inputs()) return false;
  re.setOnes(lines.count);
  im.setZero(lines.count);
  if (c % n_y_ != d % n_y_) correlation_of(of_outputs, c % n_y_, d % n_y_, lines, re, im);
  if (u == v) return true;
  Eigen::ArrayXd s_re;
  Eigen::ArrayXd s_im;
  correlation_of(of_inputs, u, v, lines, s_re, s_im);
  const Eigen::ArrayXd product = re * s_re - im * s_im;
  im = (re * s_im + im * s_re).eval();
  re = product;
  return true;
}

Eigen::MatrixXd correlated_gram(const FitProblem& problem, const NoiseCorrelation& correlation,
                                Eigen::Index n, const CorrelatedColumns& inputs) {
  GramOfTiles gram(problem, correlation, n, inputs);
  const auto channels = static_cast<Eigen::Index>(inputs.parameters.size()) * problem.n_outputs;
  const Eigen::Index N = problem.size();
  const Eigen::Index most =
      std::max<Eigen::Index>(8, kTileEntries / std::max<Eigen::Index>(1, n * channels));
  for (Eigen::Index first = 0; first < N; first += most)
    gram.add({first, std::min(most, N - first)});
  return gram.sum();
}

}  // namespace stageid
