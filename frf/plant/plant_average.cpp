#include "frf/plant/plant_average.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

/// Column k, vec of a matrix with `rows` rows, as a matrix.
Eigen::Map<Eigen::MatrixXcd> unvec(Eigen::MatrixXcd& columns, Eigen::Index k, Eigen::Index rows) {
  return {columns.col(k).data(), rows, columns.rows() / rows};
}

/// Number of lines with a common scatter, at the middle line; the others have the same number.
double lines_that_share(const RealizationSpectra& spectra) {
  const RunSpectra& run = spectra.runs().front();
  if (run.scatter_window == 0) return 1.0;
  const auto N = std::ssize(run.scatter_first);
  double sum = 0.0;
  for (Eigen::Index l = 0; l < N; ++l) sum += common_scatter(run, N / 2, l);
  return sum;
}

[[noreturn]] void refuse(LineStatus status, int realization, int line, double frequency_hz) {
  const std::string where = fmt::format("realization {} (counted from 1), line {} ({} Hz)",
                                        realization + 1, line, frequency_hz);
  if (status == LineStatus::singular_excitation)
    fail_request(
        "singular excitation in {}: the axes are not excited independently. Excite one "
        "axis per experiment, or all axes with orthogonal phases",
        where);
  fail_request(
      "singular inputs in {}: the selected actuators do not move independently. Select "
      "other inputs, or excite at the actuators",
      where);
}

}  // namespace

PlantAverage::PlantAverage(Eigen::VectorXd frequency_hz, std::vector<int> lines,
                           Eigen::Index outputs, Eigen::Index inputs, CovarianceKind covariance)
    : frequency_hz_(std::move(frequency_hz)),
      lines_(std::move(lines)),
      outputs_(outputs),
      inputs_(inputs),
      covariance_kind_(covariance),
      scatter_(outputs, inputs, frequency_hz_.size()),
      drift_(outputs, inputs, frequency_hz_.size()),
      comparison_(outputs, inputs, frequency_hz_.size()) {
  const Eigen::Index N = frequency_hz_.size();
  const Eigen::Index n_c = outputs * inputs;
  Z_sum_.setZero((outputs + inputs) * inputs, N);
  G_mean_.setZero(n_c, N);
  G_scatter_.setZero(n_c, N);
  noise_sum_.setZero(n_c, N);
  scarce_sum_.setZero(n_c, N);
  residual_sum_.setZero(outputs * outputs, N);
  input_sum_.setZero(inputs * inputs, N);
  if (covariance == CovarianceKind::full) covariance_sum_.setZero(n_c * n_c, N);
  condition_.setZero(N);
  dof_sum_.setZero(N);
  scarcity_sum_.setZero(N);
  share_sum_.setZero(N);
  misfit_sum_.setZero(N);
}

void PlantAverage::add(const RealizationSpectra& spectra, int workers,
                       const ZipperedFit* zippered) {
  ++realizations_;
  comparison_.begin(spectra.realization());
  if (zippered != nullptr) {
    zippered_axes_ = zippered->lines().axes;
    for_each_line(workers, frequency_hz_.size(),
                  [&](Eigen::Index k) { add_zippered(spectra, *zippered, k); });
    return;
  }
  noise_known_ = noise_known_ && spectra.scatter_dof() > 0;
  Eigen::VectorXd periods(spectra.experiments());
  std::ranges::transform(spectra.runs(), periods.data(), &RunSpectra::periods);
  std::vector<LineEstimate> lines(frequency_hz_.size());
  for_each_line(workers, frequency_hz_.size(), [&](Eigen::Index k) {
    LineEstimate& line = lines[k];
    line = estimate_line(spectra.excitation(k), spectra.response(k), outputs_);
    add_response(spectra, line, k);
    drift_.add(spectra, line, realizations_ - 1, k);
    dof_sum_[k] += spectra.scatter_dof(k);
  });
  if (!noise_known_) return;
  const ExperimentNoise experiments(spectra, lines, lines_that_share(spectra), workers);
  experiment_noise_ratio_ = std::max(experiment_noise_ratio_, experiments.ratio());
  noise_levels_.push_back(experiments.levels());
  for_each_line(workers, frequency_hz_.size(),
                [&](Eigen::Index k) { add_noise(spectra, lines[k], experiments, periods, k); });
}

void PlantAverage::add_noise(const RealizationSpectra& spectra, const LineEstimate& line,
                             const ExperimentNoise& experiments, const Eigen::VectorXd& periods,
                             Eigen::Index k) {
  const double dof = spectra.scatter_dof(k);
  const LineNoise noise =
      experiments.differs(k) ? experiments.scaled(line, periods, k)
                             : line_noise(line, spectra.scatter(k), spectra.scatter_dof(), periods);
  add_common(noise, k);
  scatter_.add(line, noise, experiments.level(k), dof, k);
  if (!experiments.differs(k)) {
    add_product(noise.input_part, noise.residual, dof, k);
    return;
  }
  const std::vector<Eigen::MatrixXcd> C = experiments.covariances(line, k);
  for (Eigen::Index e = 0; e < periods.size(); ++e) {
    const Eigen::VectorXcd q = line.Q.row(e).transpose();
    add_product(q * q.adjoint() / periods[e], C[e], spectra.runs()[e].dof(k), k);
  }
}

void PlantAverage::add_zippered(const RealizationSpectra& spectra, const ZipperedFit& fit,
                                Eigen::Index k) {
  const ZipperedEstimate at = fit.estimate(spectra, k);
  add_response(spectra, at.line, k);
  add_common(at.noise, k);
  add_product(at.noise.input_part, at.noise.residual, at.noise_dof, k);
  scarcity_sum_[k] += 1.0 / at.noise_dof;
  share_sum_[k] += at.variance_share;
  misfit_sum_[k] += at.misfit;
}

void PlantAverage::add_response(const RealizationSpectra& spectra, const LineEstimate& line,
                                Eigen::Index k) {
  if (line.status != LineStatus::good) {
    refuse(line.status, spectra.realization(), lines_[k], frequency_hz_[k]);
  }
  unvec(Z_sum_, k, outputs_ + inputs_) += line.Z_by_R;
  comparison_.add(line.G, k);
  condition_[k] = std::max(condition_[k], line.input_condition);

  // Welford's recursion again, for mean and scatter of the realizations' own estimates.
  for (Eigen::Index c = 0; c < G_mean_.rows(); ++c) {
    const std::complex<double> deviation = line.G.data()[c] - G_mean_(c, k);
    G_mean_(c, k) += deviation / static_cast<double>(realizations_);
    G_scatter_(c, k) += (1.0 - 1.0 / realizations_) * std::norm(deviation);
  }
}

void PlantAverage::add_common(const LineNoise& noise, Eigen::Index k) {
  unvec(residual_sum_, k, outputs_) += noise.mean_of_periods * noise.residual;
  // Hermitian in spite of rounding.
  unvec(input_sum_, k, inputs_) +=
      (0.5 / noise.mean_of_periods) * (noise.input_part + noise.input_part.adjoint());
}

/// Adds noise with covariance A kron C, C with `dof` degrees of freedom.
void PlantAverage::add_product(const Eigen::MatrixXcd& A, const Eigen::MatrixXcd& C, double dof,
                               Eigen::Index k) {
  for (Eigen::Index j = 0; j < inputs_; ++j) {
    for (Eigen::Index i = 0; i < outputs_; ++i) {
      const double variance = A(j, j).real() * C(i, i).real();
      noise_sum_(i + outputs_ * j, k) += variance;
      scarce_sum_(i + outputs_ * j, k) += variance * variance / (dof + 1.0);
    }
  }
  if (covariance_kind_ != CovarianceKind::full) return;
  Eigen::Map<Eigen::MatrixXcd> covariance = unvec(covariance_sum_, k, outputs_ * inputs_);
  for (Eigen::Index j = 0; j < inputs_; ++j) {
    for (Eigen::Index i = 0; i < inputs_; ++i) {
      covariance.block(i * outputs_, j * outputs_, outputs_, outputs_) += A(i, j) * C;
    }
  }
}

void PlantAverage::finish(FrfEstimate& frf, int workers) const {
  const double M = realizations_;
  frf.frequency_hz = frequency_hz_;
  frf.realizations = realizations_;
  frf.input_condition = condition_;
  frf.response.resize(outputs_ * inputs_, frequency_hz_.size());
  for_each_line(workers, frequency_hz_.size(), [&](Eigen::Index k) { finish_line(frf, k); });

  if (realizations_ >= 2) {
    frf.total_variance = G_scatter_ / (M * (M - 1.0));
    frf.total_dof = M - 1.0;
  }
  if (!noise_known()) {
    if (covariance_kind_ == CovarianceKind::full) {
      throw std::invalid_argument(
          "covariance: the full covariance needs two clean periods, but there is only one. Measure "
          "more periods, or use the diagonal covariance");
    }
    return;
  }
  frf.noise_dof = harmonic_mean(dof_sum_);
  if (zippered_axes_ > 0) finish_zippered(frf);
  if (experiment_noise_ratio_ > 1.0) frf.noise_dof = effective_dof();
  frf.experiment_noise_ratio = experiment_noise_ratio_;
  frf.noise_variance = noise_sum_ / (M * M);
  frf.residual_covariance = residual_sum_ / M;
  frf.input_factor = input_sum_ / (M * M);
  if (covariance_kind_ == CovarianceKind::full) frf.covariance = covariance_sum_ / (M * M);
}

/// Welch and Satterthwaite: a sum of variances a_e with nu_e degrees of freedom has (sum a)^2 / (sum a^2 / nu).
/// For estimated a, sum a^2 / (nu + 1) / (sum a)^2 has the mean 1 / (nu + 1). Averaged over lines and entries.
double PlantAverage::effective_dof() const {
  const Eigen::ArrayXXd scarcity = scarce_sum_.array() / noise_sum_.array().square();
  const Eigen::ArrayXXd known = scarcity.isFinite().select(scarcity, 0.0);
  return static_cast<double>(scarcity.isFinite().count()) / known.sum() - 1.0;
}

RealizationScatter PlantAverage::scatter() const {
  if (realizations_ < 2 || !noise_known() || zippered_axes_ > 0) return {};
  return scatter_.finish(realizations_);
}

std::optional<ModeDrift> PlantAverage::drift(const FrfEstimate& frf, int run_periods) const {
  if (zippered_axes_ > 0) return std::nullopt;
  return drift_.find(frf, G_mean_, run_periods);
}

void PlantAverage::finish_zippered(FrfEstimate& frf) const {
  const double M = realizations_;
  frf.noise_dof = M * M / scarcity_sum_.mean();
  frf.correlated_lines = static_cast<double>(zippered_axes_) * M / share_sum_.mean();
  if (misfit_sum_.minCoeff() > 0.0) frf.interpolation_misfit = misfit_sum_ / M;
}

void PlantAverage::finish_line(FrfEstimate& frf, Eigen::Index k) const {
  const Eigen::Map<const Eigen::MatrixXcd> Z(Z_sum_.col(k).data(), outputs_ + inputs_, inputs_);
  const Eigen::MatrixXcd Y = Z.topRows(outputs_);
  const Eigen::MatrixXcd U = Z.bottomRows(inputs_);
  unvec(frf.response, k, outputs_) = Y * inverse(U);
}

}  // namespace stageid
