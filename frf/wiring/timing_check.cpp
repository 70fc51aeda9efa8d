#include "frf/wiring/timing_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "frf/runs/channel_choice.hpp"
#include "frf/wiring/excitation_timing.hpp"

namespace stageid {
namespace {

constexpr int kShort = 4;  // in samples; a recorder may repeatedly lose this number

/// Equal long gaps in one run: the declared period differs from that of the records.
std::optional<Finding> wrong_period(const HealthRecord& record) {
  for (std::size_t i = 0; i < record.slips.size(); ++i)
    for (std::size_t k = i + 1; k < record.slips.size(); ++k) {
      const SampleSlip& one = record.slips[i];
      const SampleSlip& other = record.slips[k];
      if (one.run != other.run || one.lost != other.lost || std::abs(one.lost) <= kShort) continue;
      return Finding{
          Severity::fault,
          Cause::aperiodic,
          "",
          "the records are shifted repeatedly: period_samples does not match their period",
          fmt::format("by {} samples in run {}, period of {} samples", one.lost, one.run,
                      record.info.period_samples),
          "correct period_samples and the excitation of the log"};
    }
  return std::nullopt;
}

using Index = Eigen::Index;

constexpr double kMost = 0.5;        // of the lines
constexpr double kUnexcited = 1e-3;  // of the line's largest excitation

/// 1 over the excitation's power for excited actuators, otherwise 0. If the excitation is not added at actuators, 1
/// over their own power.
Eigen::VectorXd weights(const HealthRecord& record, const std::vector<Index>& actuators,
                        const Eigen::VectorXcd& R, const Eigen::MatrixXcd& U) {
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(record.n_u());
  const double smallest = kUnexcited * R.cwiseAbs().maxCoeff();
  bool all_known = true;
  for (Index r = 0; r < R.size(); ++r) {
    if (!(std::abs(R[r]) > smallest)) continue;
    const Index a = actuators[r];
    if (a < 0)
      all_known = false;
    else
      weight[a] = 1.0 / std::norm(R[r]);
  }
  if (all_known) return weight;
  for (Index a = 0; a < weight.size(); ++a) {
    const double power = U.row(a).squaredNorm();
    weight[a] = power > 0.0 ? 1.0 / power : 0.0;
  }
  return weight;
}

/// `U`: the actuators, one column per period.
bool repeats(const Eigen::MatrixXcd& U, const Eigen::VectorXd& weight) {
  const auto P = static_cast<double>(U.cols());
  const Eigen::VectorXcd mean = U.rowwise().mean();
  const Eigen::MatrixXcd deviation = U.colwise() - mean;
  const double power = weight.dot(mean.cwiseAbs2());
  const double variance =
      weight.dot(Eigen::VectorXd(deviation.rowwise().squaredNorm())) / (P - 1.0);
  return power >= std::min(1.0 + 1.0 / P, 4.0 / P) * variance;
}

/// Share of nonrepeating lines of experiment `e`; its periods are the columns from `first` on.
double share_unlike(const HealthRecord& record, const std::vector<Index>& actuators, Index e,
                    Index first) {
  const Index P = record.periods[e];
  double unlike = 0.0;
  for (const LineRecord& line : record.lines) {
    const Eigen::MatrixXcd U = line.Z.block(record.n_y(), first, record.n_u(), P);
    if (!repeats(U, weights(record, actuators, line.R.col(e), U))) unlike += 1.0;
  }
  return unlike / static_cast<double>(record.lines.size());
}

}  // namespace

std::vector<Finding> check_timing(HealthRecord& record,
                                  const std::optional<NominalStage>& nominal) {
  if (std::optional<Finding> wrong = wrong_period(record)) return {std::move(*wrong)};
  std::vector<Finding> findings;
  for (const SampleSlip& slip : record.slips) findings.push_back(to_finding(slip));
  const std::vector<Finding> aperiodic = check_repetition(record);
  findings.insert(findings.end(), aperiodic.begin(), aperiodic.end());
  if (!aperiodic.empty()) return findings;
  const std::optional<ExcitationDelay> delay = align_excitation(record, nominal);
  if (delay) findings.push_back(to_finding(*delay));
  if (record.drift) findings.push_back(to_finding(*record.drift));
  return findings;
}

std::vector<Finding> check_repetition(const HealthRecord& record) {
  if (record.lines.empty()) return {};
  const std::vector<Index> actuators = actuators_of_excitation(record.info);
  double least = 1.0;
  Index first = 0;
  Index seen = 0;
  for (Index e = 0; e < record.experiments(); ++e) {
    const Index P = record.periods[e];
    if (P >= 2) {
      least = std::min(least, share_unlike(record, actuators, e, first));
      ++seen;
    }
    first += P;
  }
  if (seen == 0 || !(least > kMost)) return {};
  return {{Severity::fault, Cause::aperiodic, "",
           "the inputs do not repeat with the period: period_samples or the excitation does not "
           "match the records",
           fmt::format("{:.0f} % of the lines, period of {} samples", 100.0 * least,
                       record.info.period_samples),
           "correct period_samples and the excitation of the log; if they are right, raise the "
           "level"}};
}

}  // namespace stageid
