#include "estimation/fit/fit_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "acquisition/files/counted.hpp"
#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/fit/mode_worth.hpp"
#include "estimation/fit/overlapping_modes.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

constexpr std::size_t kNamed = 8;          // in a message
constexpr std::size_t kChannelsNamed = 6;  // likewise

bool has_held_pole(const Submodel& s) { return s.held != HeldPole::none; }

/// Standard deviation of the frequency; if unknown, a part of the half-power width.
double deviation_hz(const Submodel& s) {
  const double width_hz = 2.0 * s.damping_ratio() * s.natural_frequency_hz();
  return s.natural_frequency_std_hz.value_or(kSmallPart * width_hz);
}

/// @param with_flank also a peak outside the lines whose flank is on the lines
bool is_between_lines(const Submodel& s, const FitRecord& record, bool with_flank) {
  const double f = s.natural_frequency_hz();
  const double reach = with_flank && s.damping_ratio() < kBroad ? s.damping_ratio() * f : 0.0;
  return f >= record.band_hz[0] - reach && f <= record.band_hz[1] + reach;
}

/// Two for the pole, plus those of a residue of its rank.
double parameters_of(const Submodel& s) {
  const auto n_y = static_cast<double>(s.numerator[0].rows());
  const auto n_u = static_cast<double>(s.numerator[0].cols());
  const double rank = s.residue_rank.value_or(0);
  const double residue = rank > 0.0 ? rank * (n_y + n_u - rank) : n_y * n_u;
  return 2.0 + static_cast<double>(s.numerator.size()) * residue;
}

bool is_worth_nothing(const FrfEstimate& frf, const FitResult& fit, std::size_t i) {
  return i < fit.removal_cost.size() &&
         fit.removal_cost[i] < ModeWorth(frf).price(fit, parameters_of(fit.model.submodels[i]));
}

bool is_unsupported(ModeVerdict verdict) {
  return verdict == ModeVerdict::weak || verdict == ModeVerdict::at_bound;
}

/// Why a mode is not a resonance of the data.
std::string reason_of(const FitResult& fit, std::size_t i, ModeVerdict verdict) {
  if (verdict == ModeVerdict::at_bound)
    return fit.model.submodels[i].damping_ratio() < kBroad
               ? "at its bound: narrower than the line spacing, undamped or unstable"
               : "at its bound";
  if (fit.model.submodels[i].held == HeldPole::guess)
    return "held, because the data need it but do not determine it";
  if (has_held_pole(fit.model.submodels[i])) return "hidden by noise and held";
  return pole_doubt(fit, i) < 1.0 ? "does not justify its parameters (BIC)"
                                  : "with a standard deviation as large";
}

/// What the data do not support, in one sentence, and the details of each mode.
struct ModeDoubt {
  std::string what;
  std::string details;
};

void judge_modes(const FrfEstimate& frf, const FitEvidence& evidence, FitResult& fit,
                 std::vector<ModeDoubt>& doubts) {
  std::vector<std::string> places;
  std::vector<std::string> frequencies;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    Submodel& s = fit.model.submodels[i];
    s.verdict.reset();
    if (!s.is_mode()) continue;
    s.verdict = mode_verdict(frf, evidence.number, fit, i);
    if (!is_unsupported(*s.verdict)) continue;
    frequencies.push_back(fmt::format("{:.6g}", s.natural_frequency_hz()));
    places.push_back(fmt::format("{:.6g} Hz (damping ratio {:.3g}, {})", s.natural_frequency_hz(),
                                 s.damping_ratio(), reason_of(fit, i, *s.verdict)));
  }
  // The fit itself has already judged modes that were requested as a list.
  if (!places.empty() && (evidence.number != ModeNumber::given || fit.trustworthy()))
    doubts.push_back(
        {fmt::format("the data do not support the modes at {} Hz: a mode placed anywhere would "
                     "improve the fit as much",
                     listed(frequencies, kNamed)),
         fmt::format(
             "the data do not support the modes at {}: a mode placed anywhere would improve "
             "the fit as much; do not interpret them as resonances",
             listed(places, kNamed))});
  for (const AlikeModes& pair : evidence.alike) {
    Submodel& one = fit.model.submodels[pair.first];
    Submodel& other = fit.model.submodels[pair.second];
    one.verdict = other.verdict = ModeVerdict::coincident;
    const std::string what = fmt::format(
        "the data do not distinguish the modes at {:.6g} and {:.6g} Hz: one mode fits as well",
        one.natural_frequency_hz(), other.natural_frequency_hz());
    doubts.push_back({what, fmt::format("{} (BIC), cost {:.6g} -> {:.6g}; request fewer modes",
                                        what, fit.model.fit.cost, pair.cost)});
  }
}

/// Of one kind. With two channels, the earlier one counts as right.
void add_late(const ChannelList& channels, const Eigen::VectorXd& delay_s,
              const Eigen::VectorXd& std_s, double sample_rate_hz, std::vector<std::string>& out) {
  if (delay_s.size() < 2) return;
  std::vector<double> sorted(delay_s.begin(), delay_s.end());
  const double middle_s = value_of_rank(sorted, (sorted.size() - 1) / 2);
  for (Eigen::Index i = 0; i < delay_s.size(); ++i) {
    const double samples = (delay_s[i] - middle_s) * sample_rate_hz;
    const double deviation = std_s.size() > i ? std_s[i] * sample_rate_hz : 0.0;
    if (std::abs(samples) > std::max(kLeastSamples, kClearly * deviation))
      out.push_back(
          fmt::format("{} {:+.3g}", channels.names[static_cast<std::size_t>(i)], samples));
  }
}

/// If an estimated delay is unknown by more than a sample, or one for all channels is clearly negative.
std::string doubtful_delay(const FitResult& fit) {
  const AdditiveModel& model = fit.model;
  if (fit.delay == DelayModel::fixed || model.input_delay_std_s.size() == 0) return {};
  const double sample_s = model.sample_rate_hz > 0.0 ? 1.0 / model.sample_rate_hz : 0.0;
  const double deviation_s =
      std::max(model.input_delay_std_s.maxCoeff(), model.output_delay_std_s.maxCoeff());
  if (sample_s > 0.0 && deviation_s > sample_s)
    return fmt::format(
        "the data do not determine {}: the standard deviation is {:.2g} us, more than a sample; if "
        "you know it, use --delay with seconds",
        fit.delay == DelayModel::estimate ? "the delay" : "the delays of the channels",
        1e6 * deviation_s);
  const double delay_s = model.mean_delay_s();
  if (fit.delay != DelayModel::estimate ||
      !(delay_s < -std::max(kClearly * deviation_s, kLeastSamples * sample_s)))
    return {};
  return fmt::format(
      "the delay is negative, {:.4g} us: the outputs come before the inputs. Check the timing of "
      "the recorder, and use --hold none if the inputs were measured rather than held",
      1e6 * delay_s);
}

}  // namespace

double pole_doubt(const FitResult& fit, std::size_t submodel) {
  const Submodel& s = fit.model.submodels[submodel];
  if (!s.is_mode() || has_held_pole(s)) return 0.0;
  if (fit.is_held(submodel)) return HUGE_VAL;
  const double of_frequency = s.natural_frequency_std_hz.value_or(0.0) / s.natural_frequency_hz();
  if (s.role == SubmodelRole::suspension) return of_frequency;
  return std::max(of_frequency, s.damping_ratio_std.value_or(0.0)) / s.damping_ratio();
}

std::optional<std::pair<std::size_t, std::size_t>> coincident_pair(const AdditiveModel& model) {
  for (const auto& [i, j] : overlapping_modes(model)) {
    const Submodel& one = model.submodels[i];
    const Submodel& other = model.submodels[j];
    if (has_held_pole(one) || has_held_pole(other)) continue;
    const double apart_hz = std::abs(one.natural_frequency_hz() - other.natural_frequency_hz());
    if (apart_hz < std::min(deviation_hz(one), deviation_hz(other))) return std::pair(i, j);
  }
  return std::nullopt;
}

ModeVerdict mode_verdict(const FrfEstimate& frf, ModeNumber number, const FitResult& fit,
                         std::size_t submodel) {
  const Submodel& s = fit.model.submodels[submodel];
  if (!is_searched_mode(s)) return ModeVerdict::determined;
  const bool asked = number == ModeNumber::asked;
  const bool beside = !is_between_lines(s, fit.model.fit, asked);
  if (!beside && fit.is_held(submodel) && !has_held_pole(s)) return ModeVerdict::at_bound;
  // Hidden by noise, or open until the last fit held it.
  if (asked ? has_held_pole(s) : !beside && s.held == HeldPole::guess) return ModeVerdict::weak;
  const bool open = !beside && pole_doubt(fit, submodel) >= 1.0;
  const bool unselected = number != ModeNumber::chosen;
  if (!has_held_pole(s) && (open || (unselected && is_worth_nothing(frf, fit, submodel))))
    return ModeVerdict::weak;
  return beside ? ModeVerdict::beside_band : ModeVerdict::determined;
}

bool supports_all_modes(const FrfEstimate& frf, const FitEvidence& evidence, const FitResult& fit) {
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i)
    if (is_unsupported(mode_verdict(frf, evidence.number, fit, i))) return false;
  return true;
}

std::vector<AlikeModes> alike_modes(const FrfEstimate& frf, const FitOptions& options,
                                    const FitResult& fit) {
  FitOptions plain = options;
  plain.uncertainty = plain.judge_modes = plain.covariance = false;
  std::vector<AlikeModes> out;
  const std::vector<std::pair<std::size_t, std::size_t>> pairs = overlapping_modes(fit.model);
  for (std::size_t p = 0; p < std::min(pairs.size(), kTried); ++p) {
    const auto [i, j] = pairs[p];
    const FitResult single = fit_additive_model(frf, with_one_of(fit.model, i, j), plain);
    const double rise =
        2.0 * static_cast<double>(frf.lines()) * (single.model.fit.cost - fit.model.fit.cost);
    if (single.status() != FitStatus::singular &&
        rise < ModeWorth(frf).price(fit, parameters_of(fit.model.submodels[i])))
      out.push_back({i, j, single.model.fit.cost});
  }
  return out;
}

std::string late_channels(const AdditiveModel& model) {
  std::vector<std::string> late;
  add_late(model.outputs, model.output_delays_s(), model.output_delay_std_s, model.sample_rate_hz,
           late);
  add_late(model.inputs, model.input_delays_s(), model.input_delay_std_s, model.sample_rate_hz,
           late);
  if (late.empty()) return {};
  return fmt::format(
      "the delays of the channels differ: {} samples relative to the others. The model contains "
      "them. If all channels should be simultaneous, check the timing of the recorder",
      listed(late, kChannelsNamed));
}

void judge(const FrfEstimate& frf, const FitEvidence& evidence, FitResult& fit) {
  const auto tell = [&](const std::string& text) {
    fit.decisions.push_back(text);
    fit.findings.push_back(text);
  };
  if (!evidence.low_ranks.empty()) tell(evidence.low_ranks);
  std::vector<ModeDoubt> doubts;
  const bool asked = evidence.number == ModeNumber::asked;
  // Without the delay, modes describe it; what the data say about them is of no use.
  if (fit.status() != FitStatus::singular && evidence.delay_denied.empty())
    judge_modes(frf, evidence, fit, doubts);
  for (const ModeDoubt& doubt : doubts) {
    tell(doubt.details);
    fit.model.fit.distrust(
        {FitStatus::undetermined, doubt.what,
         asked ? "Let the fit choose the number of modes" : "Do not interpret them as resonances",
         asked ? "--modes auto" : ""});
  }
  if (!evidence.delay_denied.empty()) {
    fit.findings.push_back(evidence.delay_denied);
    // Without the delay, a fit need not converge; that is not the reason.
    if (fit.status() != FitStatus::singular) fit.model.fit.status = FitStatus::gradient_small;
    fit.model.fit.distrust({FitStatus::unexplained, evidence.delay_denied, "", "--delay estimate"});
  }
  if (evidence.limit) {
    fit.decisions.push_back(evidence.limit->text());
    if (evidence.limit->status == FitStatus::search_budget)
      fit.findings.push_back(evidence.limit->text());
    // The message of its own status is less helpful.
    if (ended_by_limit(fit)) fit.model.fit.status = FitStatus::gradient_small;
    fit.model.fit.distrust(*evidence.limit);
  }
  if (!evidence.late_channels.empty()) tell(evidence.late_channels);
  if (!evidence.overestimated.empty()) tell(evidence.overestimated);
  if (const std::string why = doubtful_delay(fit); !why.empty()) tell(why);
  if (evidence.unexplained) {
    fit.decisions.push_back(evidence.unexplained->text());
    fit.findings.insert(fit.findings.begin(), evidence.unexplained->text());
    fit.model.fit.distrust(*evidence.unexplained);
  }
}

}  // namespace stageid
