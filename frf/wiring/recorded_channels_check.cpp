#include "frf/wiring/recorded_channels_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "frf/runs/channel_choice.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/wiring/feedback_check.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kEpsilonOnePeriod = 5e-2;  // the noise is unknown
constexpr int kMostChanges = 40;
constexpr double kOfAnother = 0.05;  // of a row's misfit, after an exchange
constexpr double kHardlyWorse = 4.0;
// Skews in samples beyond the linear range of a small skew.
constexpr double kLargestSkew = 4.0;
constexpr double kSkewStep = 0.5;

/// One line after the errors found so far have been undone.
struct Line {
  const LineRecord* record = nullptr;
  double omega_rad_s = 0.0;
  bool known = true;   // whether the controller is known here
  Eigen::MatrixXcd F;  // -C, n_u x n_y
  Eigen::MatrixXcd R;  // n_u x E
  Eigen::MatrixXcd Y;  // means, n_y x E
  Eigen::MatrixXcd U;
};

/// Deviation of the misfit U - R - F Y on three neighbouring lines from a straight line. Where the record does not repeat,
/// its two ends leave a misfit that is smooth over the lines; a wrong channel leaves one with random phases.
struct Bend {
  std::size_t first = 0;          // of its lines
  std::array<double, 3> factors;  // of their values; the sum of squares is one
  Eigen::MatrixXcd E;             // n_u x E
  Eigen::VectorXd variance;       // of E
  Eigen::VectorXd weight;         // n_u
};

struct Candidate {
  ChannelError error;
  double explained = 0.0;
  double share = 0.0;  // of the misfit of the affected rows
};

/// Combines an error with an earlier one of the same channel.
bool merge(const ChannelError& error, std::vector<ChannelError>& errors) {
  for (ChannelError& earlier : errors) {
    if (earlier.kind != error.kind || earlier.of_sensors != error.of_sensors ||
        earlier.a != error.a || error.kind == ChannelError::Kind::swap)
      continue;
    earlier.value = error.kind == ChannelError::Kind::gain ? earlier.value * error.value
                                                           : earlier.value + error.value;
    earlier.deviation = error.deviation;
    return true;
  }
  return false;
}

bool matters(const ChannelError& error) {
  switch (error.kind) {
    case ChannelError::Kind::gain:
      return std::abs(error.value - 1.0) >= kLeastGainChange;
    case ChannelError::Kind::skew:
      return std::abs(error.value) >= kLeastSkewChange_s;
    case ChannelError::Kind::swap:
      break;
  }
  return true;
}

/// Whether the same exchange was applied already. Weights depend on the record, so costs before and after an error
/// are not comparable exactly, and an exchange and its inverse could alternate forever.
bool exchanged_before(const ChannelError& error, const std::vector<ChannelError>& errors) {
  return error.kind == ChannelError::Kind::swap &&
         std::ranges::any_of(errors, [&](const ChannelError& earlier) {
           return earlier.kind == error.kind && earlier.of_sensors == error.of_sensors &&
                  earlier.a == error.a && earlier.b == error.b;
         });
}

class Search {
 public:
  Search(HealthRecord& record, const NominalStage& nominal)
      : record_(record),
        lines_(record.lines.size()),
        noise_known_(record.scatter_dof() > 0),
        epsilon_(noise_known_ ? nominal.controller_error
                              : std::max(kEpsilonOnePeriod, nominal.controller_error)) {
    const auto u = positions_in(nominal.actuators, record.info.actuators.names);
    const auto y = positions_in(nominal.sensors, record.info.sensors.names);
    const std::vector<Index> excited = excited_actuators(record.info, record.axes);
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      const double frequency_hz = record.frequency_hz[k];
      lines_[k].record = &record.lines[k];
      lines_[k].omega_rad_s = 2.0 * std::numbers::pi * frequency_hz;
      lines_[k].known =
          frequency_hz >= nominal.controller_from_hz && frequency_hz <= nominal.controller_to_hz;
      lines_[k].F = lines_[k].known ? Eigen::MatrixXcd(nominal.controller(frequency_hz)(u, y))
                                    : Eigen::MatrixXcd::Zero(record.n_u(), record.n_y());
      lines_[k].R = Eigen::MatrixXcd::Zero(record.n_u(), record.experiments());
      for (std::size_t a = 0; a < excited.size(); ++a)
        lines_[k].R.row(excited[a]) = record.lines[k].R.row(record.axes[a]);
    }
    for (std::size_t k = 0; k + 2 < lines_.size(); k += 3) {
      if (!lines_[k].known || !lines_[k + 1].known || !lines_[k + 2].known) continue;
      const double whole = lines_[k + 2].omega_rad_s - lines_[k].omega_rad_s;
      const double above = (lines_[k + 1].omega_rad_s - lines_[k].omega_rad_s) / whole;
      const double size = std::sqrt(1.0 + above * above + (1.0 - above) * (1.0 - above));
      bends_.push_back({k, {(above - 1.0) / size, 1.0 / size, -above / size}, {}, {}, {}});
    }
  }

  RecordedChannelsCheck run() {
    RecordedChannelsCheck check;
    refresh();
    for (int i = 0; i < kMostChanges; ++i) {
      candidates_.clear();
      try_sensors();
      try_actuators();
      const std::optional<Candidate> chosen = best();
      if (!chosen || exchanged_before(chosen->error, check.errors)) break;
      undo(chosen->error, record_);
      if (!merge(chosen->error, check.errors)) check.errors.push_back(chosen->error);
      refresh();
    }
    // Two changes of a channel may cancel each other.
    std::erase_if(check.errors, [](const ChannelError& error) { return !matters(error); });
    check.misfits = misfits();
    // Then another controller, or a setpoint, is the cause.
    if (!check.misfits.empty() && check.misfits.front().of_all) {
      for (std::size_t n = check.errors.size(); n-- > 0;) undo(inverse(check.errors[n]), record_);
      check.errors.clear();
      refresh();
      check.misfits = misfits();
    }
    return check;
  }

  /// Whether there is nothing to search for.
  bool holds() {
    refresh();
    for (Index a = 0; a < record_.n_u(); ++a)
      if (exceeds(a, [a](const Bend& bend) { return 1.0 / bend.weight[a]; })) return false;
    return true;
  }

  double unexplained_motion() const {
    double unexplained = 0.0;
    double controlled = 0.0;
    for (const Line& line : lines_) {
      if (!line.known) continue;
      const Eigen::MatrixXcd& Z = line.record->Z;
      const Eigen::MatrixXcd by_controller = line.F * Z.topRows(record_.n_y());
      unexplained += record_.scatter(Z.bottomRows(record_.n_u()) - by_controller).trace().real();
      controlled += record_.scatter(by_controller).trace().real();
    }
    return controlled > 0.0 ? unexplained / controlled : 1.0;
  }

 private:
  void refresh() {
    for (Line& line : lines_) {
      line.Y = record_.mean(line.record->Z.topRows(record_.n_y()));
      line.U = record_.mean(line.record->Z.bottomRows(record_.n_u()));
    }
    total_ = 0.0;
    for (Bend& bend : bends_) {
      bend.E = bent(bend, [](const Line& line) {
        return Eigen::MatrixXcd(line.U - line.R - line.F * line.Y);
      });
      bend.variance = record_.variance_of_mean(bent(bend, [this](const Line& line) {
        const Eigen::MatrixXcd& Z = line.record->Z;
        return Eigen::MatrixXcd(Z.bottomRows(record_.n_u()) - line.F * Z.topRows(record_.n_y()));
      }));
      Eigen::VectorXd others = Eigen::VectorXd::Constant(record_.n_u(), 1e-300);
      for (std::size_t i = 0; i < 3; ++i) {
        const Line& line = lines_[bend.first + i];
        const auto squares = [&](const Eigen::MatrixXcd& X) {
          return Eigen::VectorXd(X.rowwise().squaredNorm() / static_cast<double>(X.cols()));
        };
        others += bend.factors[i] * bend.factors[i] *
                  (epsilon_ * epsilon_ * squares(line.F * line.Y) +
                   kFeedbackRounding * kFeedbackRounding * (squares(line.U) + squares(line.R)));
      }
      bend.weight = (bend.variance + others).cwiseInverse();
      total_ += (bend.weight.asDiagonal() * bend.E.cwiseAbs2()).sum();
    }
  }

  /// The deviation of any signal, a function of a line, from a straight line.
  template <typename Signal>
  Eigen::MatrixXcd bent(const Bend& bend, const Signal& signal) const {
    Eigen::MatrixXcd sum = bend.factors[0] * signal(lines_[bend.first]);
    for (std::size_t i = 1; i < 3; ++i) sum += bend.factors[i] * signal(lines_[bend.first + i]);
    return sum;
  }

  std::optional<Candidate> best() const {
    const Candidate* most = nullptr;
    for (const Candidate& candidate : candidates_)
      if (candidate.share >= kLeastChangeShare &&
          (most == nullptr || candidate.explained > most->explained))
        most = &candidate;
    return most != nullptr ? std::optional<Candidate>(*most) : std::nullopt;
  }

  double row_cost(Index row) const {
    return sum_over_bends(
        [row](const Bend& bend) { return bend.weight[row] * bend.E.row(row).squaredNorm(); });
  }

  /// The same for all sensors: whether C y is r - u up to a factor.
  bool sensors_follow() const {
    const auto controlled = [](const Line& line) { return Eigen::MatrixXcd(line.F * line.Y); };
    return proportional(0, record_.n_u(), controlled,
                        [](const Line& line) { return Eigen::MatrixXcd(line.U - line.R); });
  }

  /// Whether u of these actuators is r - C y up to a factor. Otherwise an actuator with other motion would be explained
  /// by a factor that makes it vanish.
  bool commands_follow(Index first, Index rows) const {
    return proportional(
        first, rows, [](const Line& line) { return line.U; },
        [](const Line& line) { return Eigen::MatrixXcd(line.R + line.F * line.Y); });
  }

  /// Whether two signals of these actuators, functions of a line, are equal up to a factor.
  template <typename One, typename Other>
  bool proportional(Index first, Index rows, const One& one, const Other& other) const {
    double along = 0.0;
    double of_one = 0.0;
    double of_other = 0.0;
    for (const Bend& bend : bends_) {
      const Eigen::MatrixXcd A = bent(bend, one).middleRows(first, rows);
      const Eigen::MatrixXcd B = bent(bend, other).middleRows(first, rows);
      const auto w = bend.weight.segment(first, rows);
      along += (w.asDiagonal() * A.conjugate().cwiseProduct(B).real()).sum();
      of_one += (w.asDiagonal() * A.cwiseAbs2()).sum();
      of_other += (w.asDiagonal() * B.cwiseAbs2()).sum();
    }
    return along * along > 0.5 * of_one * of_other;
  }

  /// Tries E - d X with X of `direction`, rows x E.
  template <typename Direction>
  void try_direction(ChannelError error, double cost, Index first, Index rows,
                     const Direction& direction) {
    double along = 0.0;
    double length = 0.0;
    for (const Bend& bend : bends_) {
      const Eigen::MatrixXcd X = bent(bend, direction);
      const auto w = bend.weight.segment(first, rows);
      along += (w.asDiagonal() * X.cwiseProduct(bend.E.middleRows(first, rows).conjugate()).real())
                   .sum();
      length += (w.asDiagonal() * X.cwiseAbs2()).sum();
    }
    if (!(length > 0.0)) return;
    const double d = along / length;
    const double deviation = 1.0 / std::sqrt(2.0 * length);
    if (std::abs(d) < kChangeDeviations * deviation) return;
    if (error.kind == ChannelError::Kind::gain) {
      // The true signal is (1 + d) times the recorded one.
      error.value = 1.0 / (1.0 + d);
      error.deviation = noise_known_ ? deviation * error.value * error.value : 0.0;
      if (!std::isfinite(error.value)) return;
    } else {
      error.value = d;
      error.deviation = deviation;
      if (!noise_known_) return;
    }
    if (!matters(error)) return;
    candidates_.push_back({error, along * d, along * d / cost});
  }

  void try_swap(ChannelError error, double cost, double after) {
    if (cost - after > kChangeDeviations * kChangeDeviations)
      candidates_.push_back({error, cost - after, (cost - after) / cost});
  }

  /// Tries large skews, beyond the linear range of a small one.
  void try_whole_skews(Index a, double cost) {
    if (!noise_known_) return;
    for (double samples = -kLargestSkew; samples <= kLargestSkew; samples += kSkewStep) {
      const double skew_s = samples / record_.info.sample_rate_hz;
      double length = 0.0;
      const double after = sum_over_bends([&](const Bend& bend) {
        length += bend.weight[a] * bent(bend, [a](const Line& line) {
                                     return Eigen::MatrixXcd(line.omega_rad_s * line.U.row(a));
                                   }).squaredNorm();
        const Eigen::MatrixXcd turned = bent(bend, [a, skew_s](const Line& line) {
          const std::complex<double> turn = std::polar(1.0, line.omega_rad_s * skew_s) - 1.0;
          return Eigen::MatrixXcd(turn * line.U.row(a));
        });
        return bend.weight[a] * (bend.E.row(a) + turned).squaredNorm();
      });
      if (after > (1.0 - kLeastChangeShare) * cost || !(length > 0.0)) continue;
      ChannelError error{ChannelError::Kind::skew, false, a};
      error.value = skew_s;
      error.deviation = 1.0 / std::sqrt(2.0 * length);
      try_swap(error, cost, after);
    }
  }

  template <typename Term>
  double sum_over_bends(const Term& term) const {
    double sum = 0.0;
    for (const Bend& bend : bends_) sum += term(bend);
    return sum;
  }

  /// A skew of s acts along j omega s times the direction of a gain. @param a -1: all channels of the kind
  template <typename Direction>
  void try_gain_and_skew(bool of_sensors, Index a, bool follows, double cost, Index first,
                         Index rows, const Direction& direction) {
    if (follows)
      try_direction({ChannelError::Kind::gain, of_sensors, a}, cost, first, rows, direction);
    try_direction({ChannelError::Kind::skew, of_sensors, a}, cost, first, rows,
                  [&](const Line& line) {
                    const std::complex<double> j_omega(0.0, line.omega_rad_s);
                    return Eigen::MatrixXcd(j_omega * direction(line));
                  });
  }

  void try_sensors() {
    const Index n_u = record_.n_u();
    try_gain_and_skew(true, -1, sensors_follow(), total_, 0, n_u,
                      [](const Line& line) { return Eigen::MatrixXcd(line.F * line.Y); });
    for (Index s = 0; s < record_.n_y(); ++s) {
      try_gain_and_skew(true, s, true, total_, 0, n_u, [&](const Line& line) {
        return Eigen::MatrixXcd(line.F.col(s) * line.Y.row(s));
      });
      for (Index t = 0; t < s; ++t)
        try_swap({ChannelError::Kind::swap, true, t, s}, total_,
                 sum_over_bends([&](const Bend& bend) {
                   const Eigen::MatrixXcd exchanged = bent(bend, [s, t](const Line& line) {
                     return Eigen::MatrixXcd((line.F.col(s) - line.F.col(t)) *
                                             (line.Y.row(t) - line.Y.row(s)));
                   });
                   return (bend.weight.asDiagonal() * (bend.E - exchanged).cwiseAbs2()).sum();
                 }));
    }
  }

  void try_actuators() {
    const Index n_u = record_.n_u();
    try_gain_and_skew(false, -1, commands_follow(0, n_u), total_, 0, n_u,
                      [](const Line& line) { return Eigen::MatrixXcd(-line.U); });
    for (Index a = 0; a < n_u; ++a) {
      const double cost = row_cost(a);
      if (!(cost > 0.0) || !significant(a)) continue;
      try_gain_and_skew(false, a, commands_follow(a, 1), cost, a, 1,
                        [&](const Line& line) { return Eigen::MatrixXcd(-line.U.row(a)); });
      try_whole_skews(a, cost);
      for (Index b = 0; b < a; ++b) {
        const double cost_b = row_cost(b);
        const auto exchanged = [this](Index row, Index with) {
          return sum_over_bends([this, row, with](const Bend& bend) {
            const Eigen::MatrixXcd change = bent(bend, [row, with](const Line& line) {
              return Eigen::MatrixXcd(line.U.row(with) - line.U.row(row));
            });
            return bend.weight[row] * (bend.E.row(row) + change).squaredNorm();
          });
        };
        const double after_a = exchanged(a, b);
        const double after_b = exchanged(b, a);
        // Both rows must improve, or one must be explained completely while the other hardly gets worse (three exchanged
        // channels are corrected one by one).
        const bool both = after_a < 0.5 * cost && after_b < 0.5 * cost_b;
        const bool one = (after_a < kOfAnother * cost && after_b < kHardlyWorse * cost_b) ||
                         (after_b < kOfAnother * cost_b && after_a < kHardlyWorse * cost);
        if (!both && !one) continue;
        try_swap({ChannelError::Kind::swap, false, b, a}, cost + cost_b, after_a + after_b);
      }
    }
  }

  std::vector<ControllerMisfit> misfits() const {
    std::vector<ControllerMisfit> found;
    Index driven = 0;
    for (Index a = 0; a < record_.n_u(); ++a) {
      double misfit = 0.0;
      for (const Bend& bend : bends_) misfit += bend.E.row(a).squaredNorm();
      misfit *= 3.0;
      double controlled = 0.0;
      double moved = 0.0;
      for (const Line& line : lines_) {
        controlled += (line.F.row(a) * line.Y).squaredNorm();
        moved += line.U.row(a).squaredNorm();
      }
      if (controlled > 0.0) ++driven;
      const bool is_controlled = controlled > kFeedbackRounding * kFeedbackRounding * moved;
      const double whole = is_controlled ? controlled : moved;
      const double relative = std::sqrt(misfit / std::max(whole, 1e-300));
      if (relative > kLeastMisfit && significant(a))
        found.push_back({a, relative, is_controlled, false});
    }
    const bool of_all = 2 * std::ssize(found) > driven && found.size() > 1;
    for (ControllerMisfit& misfit : found) misfit.of_all = of_all;
    return found;
  }

  bool significant(Index row) const {
    return !noise_known_ || exceeds(row, [row](const Bend& bend) { return bend.variance[row]; });
  }

  /// Whether the misfit of an actuator is more than chance. @param noise_of its variance, of a bend
  template <typename Noise>
  bool exceeds(Index row, const Noise& noise_of) const {
    double evidence = 0.0;
    for (const Bend& bend : bends_) {
      const auto E = static_cast<int>(bend.E.cols());
      const double mean_square = bend.E.row(row).squaredNorm() / E;
      const double noise = noise_of(bend);
      if (noise > 0.0)
        evidence -= log_tail_of_f(mean_square / noise, E, std::max(1, record_.scatter_dof()));
      else if (mean_square > 0.0)
        evidence += 1e3;
    }
    return tail_of_evidence(evidence, std::ssize(bends_)) <
           kSignificance / static_cast<double>(record_.n_u());
  }

  HealthRecord& record_;
  std::vector<Line> lines_;
  std::vector<Bend> bends_;  // of lines 0 to 2, 3 to 5, ...
  bool noise_known_;
  double epsilon_;  // relative error of the model of the controller, of C y
  double total_ = 0.0;
  std::vector<Candidate> candidates_;
};

}  // namespace

bool follows_controller(HealthRecord& record, const NominalStage& nominal) {
  return Search(record, nominal).holds();
}

double unexplained_motion(HealthRecord& record, const NominalStage& nominal) {
  return Search(record, nominal).unexplained_motion();
}

RecordedChannelsCheck check_recorded_channels(HealthRecord& record, const NominalStage& nominal) {
  return Search(record, nominal).run();
}

}  // namespace stageid
