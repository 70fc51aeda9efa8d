#include "frf/plant/realization_comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;
using Kind = RealizationChange::Kind;

constexpr Index kMostLines = 400;
constexpr double kWorthSearching = 1.5;  // of the misfit that noise alone has
constexpr double kOutlying = 4.0;        // of the median misfit of the realizations
constexpr double kMostLeft = 0.5;        // of the misfit, after all changes
constexpr double kMostSamples = 4.0;
constexpr double kSampleStep = 0.25;
constexpr double kExactResponse = 1e-4;  // of the rms of a row: less is not examined

/// A block of G, on every line.
struct Part {
  Index row = 0;
  Index rows = 0;
  Index column = 0;
  Index columns = 0;
  friend bool operator==(const Part&, const Part&) = default;
};

struct Candidate {
  Kind kind = Kind::gain;
  Part part;
  Part with;  // swap
  double value = 1.0;
  double deviation = 0.0;
  double explained = 0.0;
};

/// One realization against the reference.
class Comparison {
 public:
  Comparison(MatrixXcd response, const MatrixXcd& reference, const MatrixXd& weight,
             const VectorXd& omega_rad_s, Index outputs, double sample_rate_hz)
      : G_(std::move(response)),
        reference_(reference),
        weight_(weight),
        omega_(omega_rad_s),
        n_y_(outputs),
        n_u_(reference.rows() / outputs),
        sample_s_(sample_rate_hz > 0.0 ? 1.0 / sample_rate_hz : 0.0) {
    for (Index y = 0; y < n_y_; ++y) channels_.push_back({y, 1, 0, n_u_});
    for (Index u = 0; u < n_u_; ++u) channels_.push_back({0, n_y_, u, 1});
  }

  double misfit() const { return (weight_.array() * (G_ - reference_).array().abs2()).mean(); }

  std::vector<Candidate> run() {
    std::vector<Candidate> found;
    const double before = misfit();
    if (!(before > kWorthSearching) &&
        std::ranges::none_of(channels_, [this](const Part& part) { return exceeds_noise(part); }))
      return found;
    for (std::size_t i = 0; i < channels_.size(); ++i) {
      std::optional<Candidate> best;
      const auto offer = [&](const std::optional<Candidate>& one) {
        if (one && (!best || one->explained > best->explained)) best = one;
      };
      for (const Part& part : channels_) try_part(part, offer);
      if (n_y_ > 1 && n_u_ > 1) try_part({0, n_y_, 0, n_u_}, offer);
      const auto rows = static_cast<std::size_t>(n_y_);
      for (std::size_t p = 0; p < channels_.size(); ++p)
        for (std::size_t q = p < rows ? 0 : rows; q < p; ++q)
          offer(exchange(channels_[q], channels_[p]));
      if (!best) break;
      undo(*best);
      include(*best, found);
    }
    std::erase_if(found,
                  [](const Candidate& change) { return !is_change(change.kind, change.value); });
    // Changed channels explain most of the misfit, a disturbance only that of some lines.
    if (misfit() > kMostLeft * before) found.clear();
    return found;
  }

 private:
  template <typename Term>
  void over(const Part& part, const Term& term) const {
    for (Index k = 0; k < G_.cols(); ++k)
      for (Index u = part.column; u < part.column + part.columns; ++u)
        for (Index y = part.row; y < part.row + part.rows; ++y) term(y + n_y_ * u, k);
  }

  double misfit_of(const Part& part) const {
    double sum = 0.0;
    over(part,
         [&](Index c, Index k) { sum += weight_(c, k) * std::norm(G_(c, k) - reference_(c, k)); });
    return sum;
  }

  double entries(const Part& part) const {
    return static_cast<double>(part.rows * part.columns * G_.cols());
  }

  bool exceeds_noise(const Part& part) const {
    return misfit_of(part) > kWorthSearching * entries(part);
  }

  static bool is_change(Kind kind, double value) {
    switch (kind) {
      case Kind::gain:
        return std::abs(value - 1.0) > kLeastGainChange;
      case Kind::skew:
        return std::abs(value) > kLeastSkewChange_s;
      case Kind::swap:
        return true;
    }
    return true;
  }

  /// A part that is changed twice in the same way is changed by both together; they may cancel.
  static void include(const Candidate& change, std::vector<Candidate>& found) {
    const auto same = std::ranges::find_if(found, [&](const Candidate& other) {
      return other.kind == change.kind && other.part == change.part;
    });
    if (same == found.end() || change.kind == Kind::swap)
      found.push_back(change);
    else if (change.kind == Kind::skew)
      same->value += change.value;
    else
      same->value *= change.value;
  }

  /// Whether the explained part is significant beside the rest, for real numbers.
  bool significant(const Part& part, double misfit, double explained) const {
    const double dof = std::max(1.0, 2.0 * entries(part) - 1.0);
    const double rest = std::max(0.0, misfit - explained);
    return explained > kLeastChangeShare * misfit &&
           explained > kChangeDeviations * kChangeDeviations * std::max(0.5, rest / dof);
  }

  /// Some lines of a part, compared with the reference.
  struct Sums {
    VectorXcd cross;
    double misfit = 0.0;
    double length = 0.0;
    double bend = 0.0;
    double power = 0.0;

    double gain() const { return length > 0.0 ? cross.sum().real() / length : 1.0; }
  };

  /// Of all lines, or of those with an even or odd index.
  Sums sums_of(const Part& part, Index first = 0, Index step = 1) const {
    Sums sums;
    sums.cross = VectorXcd::Zero(G_.cols());
    over(part, [&](Index c, Index k) {
      if (k % step != first) return;
      sums.cross[k] += weight_(c, k) * std::conj(reference_(c, k)) * G_(c, k);
      const double square = weight_(c, k) * std::norm(reference_(c, k));
      sums.length += square;
      sums.bend += square * omega_[k] * omega_[k];
      sums.power += weight_(c, k) * std::norm(G_(c, k));
      sums.misfit += weight_(c, k) * std::norm(G_(c, k) - reference_(c, k));
    });
    return sums;
  }

  /// Of the misfit, by a gain and a skew.
  double explained(const Sums& sums, double gain, double skew_s) const {
    return sums.misfit -
           (sums.power - 2.0 * gain * along(sums.cross, skew_s) + gain * gain * sums.length);
  }

  template <typename Offer>
  void try_part(const Part& part, const Offer& offer) const {
    if (!exceeds_noise(part)) return;
    const Sums all = sums_of(part);
    if (!(all.length > 0.0)) return;
    // A value from one half of the lines must explain the other half; that of a few disturbed lines does not.
    const Sums even = sums_of(part, 0, 2);
    const Sums odd = sums_of(part, 1, 2);
    const auto offer_if = [&](Kind kind, double value, double length, double confirmed) {
      if (significant(part, all.misfit, confirmed))
        offer(std::optional<Candidate>(
            {kind, part, {}, value, 1.0 / std::sqrt(2.0 * length), confirmed}));
    };
    if (is_change(Kind::gain, all.gain()))
      offer_if(Kind::gain, all.gain(), all.length,
               explained(even, odd.gain(), 0.0) + explained(odd, even.gain(), 0.0));
    if (sample_s_ == 0.0) return;
    const double skew_s = best_skew(all.cross);
    if (is_change(Kind::skew, skew_s))
      offer_if(
          Kind::skew, skew_s, all.bend,
          explained(even, 1.0, best_skew(odd.cross)) + explained(odd, 1.0, best_skew(even.cross)));
  }

  double along(const VectorXcd& cross, double skew_s) const {
    double sum = 0.0;
    for (Index k = 0; k < cross.size(); ++k)
      sum += (cross[k] * std::polar(1.0, omega_[k] * skew_s)).real();
    return sum;
  }

  double best_skew(const VectorXcd& cross) const {
    double best = 0.0;
    double largest = along(cross, 0.0);
    const auto look = [&](double skew_s) {
      const double here = along(cross, skew_s);
      if (!(here > largest)) return;
      largest = here;
      best = skew_s;
    };
    for (double samples = -kMostSamples; samples <= kMostSamples; samples += kSampleStep)
      look(samples * sample_s_);
    for (int pass = 0; pass < 3; ++pass) {  // Newton
      double slope = 0.0;
      double bend = 0.0;
      for (Index k = 0; k < cross.size(); ++k) {
        const std::complex<double> turned = cross[k] * std::polar(1.0, omega_[k] * best);
        slope -= omega_[k] * turned.imag();
        bend -= omega_[k] * omega_[k] * turned.real();
      }
      if (bend < 0.0) look(best - slope / bend);
    }
    return best;
  }

  std::optional<Candidate> exchange(const Part& one, const Part& other) const {
    const double before[] = {misfit_of(one), misfit_of(other)};
    if (before[0] < kWorthSearching * entries(one) || before[1] < kWorthSearching * entries(other))
      return std::nullopt;
    const Index apart = other.row - one.row + n_y_ * (other.column - one.column);
    double after[] = {0.0, 0.0};
    over(one, [&](Index c, Index k) {
      after[0] += weight_(c, k) * std::norm(G_(c + apart, k) - reference_(c, k));
      after[1] += weight_(c + apart, k) * std::norm(G_(c, k) - reference_(c + apart, k));
    });
    const double explained = before[0] + before[1] - after[0] - after[1];
    if (after[0] > 0.5 * before[0] || after[1] > 0.5 * before[1] ||
        explained < kChangeDeviations * kChangeDeviations)
      return std::nullopt;
    return Candidate{Kind::swap, one, other, 1.0, 0.0, explained};
  }

  void undo(const Candidate& change) {
    const Index apart =
        change.with.row - change.part.row + n_y_ * (change.with.column - change.part.column);
    over(change.part, [&](Index c, Index k) {
      switch (change.kind) {
        case Kind::gain:
          // A dead channel has nothing left to examine.
          if (std::abs(change.value) > kLeastGainChange)
            G_(c, k) /= change.value;
          else
            G_(c, k) = reference_(c, k);
          break;
        case Kind::skew:
          G_(c, k) *= std::polar(1.0, omega_[k] * change.value);
          break;
        case Kind::swap:
          std::swap(G_(c, k), G_(c + apart, k));
          break;
      }
    });
  }

  MatrixXcd G_;
  const MatrixXcd& reference_;
  const MatrixXd& weight_;
  const VectorXd& omega_;
  Index n_y_;
  Index n_u_;
  double sample_s_;
  std::vector<Part> channels_;  // the rows, then the columns
};

/// Median of the real and of the imaginary parts; of two, the first.
MatrixXcd reference_of(const std::vector<MatrixXcd>& responses) {
  if (responses.size() == 2) return responses.front();
  MatrixXcd reference(responses.front().rows(), responses.front().cols());
  std::vector<double> real(responses.size());
  std::vector<double> imag(responses.size());
  for (Index i = 0; i < reference.size(); ++i) {
    for (std::size_t m = 0; m < responses.size(); ++m) {
      real[m] = responses[m].data()[i].real();
      imag[m] = responses[m].data()[i].imag();
    }
    reference.data()[i] = {median(real), median(imag)};
  }
  return reference;
}

/// A column; the only sensor is named before the only actuator.
bool is_actuator(const Part& part, const FrfEstimate& frf) {
  return part.columns == 1 && part.rows == frf.n_outputs() && frf.n_outputs() + frf.n_inputs() > 2;
}

std::string name_of(const Part& part, const FrfEstimate& frf) {
  if (is_actuator(part, frf)) return frf.inputs.name(part.column);
  if (part.rows > 1) return "all sensors";
  return frf.outputs.name(part.row);
}

/// The factor of a column of G is one over that of the actuator's record.
RealizationChange described(const Candidate& change, const FrfEstimate& frf) {
  RealizationChange found;
  found.kind = change.kind;
  found.channel = name_of(change.part, frf);
  if (change.kind == Kind::swap)
    found.channel = fmt::format("{} {}", found.channel, name_of(change.with, frf));
  found.value = change.value;
  found.deviation = change.deviation;
  if (!is_actuator(change.part, frf)) return found;
  if (change.kind == Kind::skew) found.value = -change.value;
  if (change.kind == Kind::gain && std::abs(change.value) > kLeastGainChange) {
    found.value = 1.0 / change.value;
    found.deviation = change.deviation * found.value * found.value;
  }
  return found;
}

}  // namespace

RealizationComparison::RealizationComparison(Index outputs, Index inputs, Index lines)
    : outputs_(outputs),
      inputs_(inputs),
      every_((lines + kMostLines - 1) / kMostLines),
      kept_((lines + every_ - 1) / std::max<Index>(1, every_)) {}

void RealizationComparison::begin(int realization) {
  realization_.push_back(realization);
  responses_.emplace_back(outputs_ * inputs_, kept_);
}

void RealizationComparison::add(const MatrixXcd& G, Index k) {
  if (k % every_ == 0) responses_.back().col(k / every_) = G.reshaped();
}

RealizationDifferences RealizationComparison::find(const FrfEstimate& frf) const {
  RealizationDifferences found;
  const std::size_t M = responses_.size();
  if (M < 2) return found;
  const MatrixXcd reference = reference_of(responses_);
  VectorXd omega_rad_s(kept_);
  MatrixXd weight(reference.rows(), kept_);
  for (Index k = 0; k < kept_; ++k) {
    omega_rad_s[k] = 2.0 * std::numbers::pi * frf.frequency_hz[k * every_];
    const VectorXd row_power =
        reference.col(k).reshaped(outputs_, inputs_).rowwise().squaredNorm() /
        static_cast<double>(inputs_);
    weight.col(k) =
        (kExactResponse * kExactResponse * row_power.replicate(inputs_, 1)).array() + 1e-300;
    if (frf.noise_variance.size() > 0)
      weight.col(k) += static_cast<double>(M) * frf.noise_variance.col(k * every_);
  }
  weight = (2.0 * weight).cwiseInverse();
  std::vector<double> misfits;
  for (std::size_t m = M == 2 ? 1 : 0; m < M; ++m) {
    Comparison comparison(responses_[m], reference, weight, omega_rad_s, outputs_,
                          frf.sample_rate_hz);
    misfits.push_back(comparison.misfit());
    for (const Candidate& candidate : comparison.run()) {
      RealizationChange change = described(candidate, frf);
      change.realization = realization_[m];
      if (M == 2) change.other = realization_.front();
      found.changes.push_back(std::move(change));
    }
  }
  std::vector<double> sorted = misfits;
  const double usual = M == 2 ? 0.0 : median(sorted);
  for (std::size_t i = 0; i < misfits.size(); ++i)
    if (misfits[i] > kWorthSearching && misfits[i] > kOutlying * usual)
      found.outlying.push_back(realization_[i + (M == 2 ? 1 : 0)]);
  return found;
}

}  // namespace stageid
