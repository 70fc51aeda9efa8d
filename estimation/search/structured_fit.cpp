#include "estimation/search/structured_fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/modal/line_correlation.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/search/proposed_modes.hpp"
#include "estimation/search/search_advice.hpp"
#include "estimation/uncertainty/dense_covariance.hpp"
#include "estimation/uncertainty/mode_shape_deviation.hpp"

namespace stageid {
namespace {

std::vector<Submodel> suspension_modes(const FrfEstimate& frf,
                                       const std::vector<double>& known_hz) {
  if (known_hz.empty()) return {suspension_mode(frf, kSuspensionStart * frf.frequency_hz[0])};
  std::vector<Submodel> out;
  for (const double frequency_hz : known_hz) {
    out.push_back(suspension_mode(frf, frequency_hz));
    out.back().held = HeldPole::frequency;
  }
  return out;
}

/// Adds start values to requests without them.
class PoleSearch {
 public:
  PoleSearch(const FrfEstimate& frf, ModelStructure common, const ModeSelection& selection,
             const FitOptions& options, std::vector<std::string>& decisions)
      : frf_(frf),
        common_(std::move(common)),
        selection_(selection),
        quick_(options),
        decisions_(decisions) {
    quick_.uncertainty = false;
    quick_.method = FitMethod::gn;
    quick_.residue_rank = quick_.rigid_body_rank = 0;
  }

  void complete(std::vector<SubmodelRequest>& requests) {
    const int pairs = std::accumulate(
        requests.begin(), requests.end(), 0,
        [](int sum, const SubmodelRequest& r) { return sum + (r.has_start() ? 0 : r.pairs()); });
    const bool by_statistics = !requests.empty() && requests.front().order_by_search;
    if (pairs > 0 || by_statistics) deal(modes(requests, pairs), requests);
    for (std::size_t i = 0; i < requests.size(); ++i)
      if (requests[i].has_real_pole() &&
          requests[i].frequency_hz.size() < static_cast<std::size_t>(requests[i].pairs()) + 1)
        place_real_pole(requests, i);
  }

 private:
  /// Substitutes for the submodels while modes are searched: those with a start themselves, the others by their parts
  /// without poles.
  ModelStructure stand_in(const std::vector<SubmodelRequest>& requests) const {
    ModelStructure out = common_;
    for (const ModeCandidate& mode : selection_.modes) {  // taken: the search is for others
      out.given.push_back(mode_submodel(frf_, common_, mode));
      out.given.back().role = SubmodelRole::given;
    }
    for (const SubmodelRequest& r : requests) {
      if (r.has_start()) {
        out.given.push_back(start_submodel(frf_, r));
        continue;
      }
      const auto [l, n, m] = r.shape;
      if (l > 0)
        out.given.push_back(
            start_submodel(frf_, {{l, 0, r.biproper() ? l : l - 1}, false, {}, {}}));
      else if (r.biproper())
        out.given.push_back(start_submodel(frf_, {{0, 0, 0}, false, {}, {}}));
      if (r.order_by_search || (n >= 2 && m > 0)) out.general_damping = true;
    }
    return out;
  }

  /// @param pairs 0: as many as are worth their parameters
  std::vector<const Submodel*> modes(const std::vector<SubmodelRequest>& requests, int pairs) {
    const ModelStructure structure = stand_in(requests);
    ModeSelection selection;
    selection.exactly = pairs;
    found_ = automatic_fit(frf_, structure, selection, quick_);
    std::vector<const Submodel*> out;
    for (const Submodel& s : found_.model.submodels)
      if (is_searched_mode(s)) out.push_back(&s);
    if (static_cast<int>(out.size()) < pairs)
      throw std::invalid_argument(fmt::format(
          "fit: the submodels need {} of poles, but {} were found; give their frequencies",
          counted(pairs, "pair"), out.size()));
    if (pairs == 0 && static_cast<int>(2 * out.size()) > kLargestOrder)
      throw std::invalid_argument(
          fmt::format("fit: n=auto found {} modes, but one denominator supports at most {}; use a "
                      "narrower band or several submodels",
                      out.size(), kLargestOrder / 2));
    return out;
  }

  void deal(const std::vector<const Submodel*>& modes, std::vector<SubmodelRequest>& requests) {
    auto next = modes.begin();
    for (SubmodelRequest& r : requests) {
      if (r.has_start()) continue;
      if (r.order_by_search) {
        r.order_by_search = false;
        r.shape.order = 2 * static_cast<int>(modes.size());
        r.shape.numerator_degree = r.shape.order - 1;
      }
      for (int i = 0; i < r.pairs(); ++i, ++next) {
        r.frequency_hz.push_back((*next)->natural_frequency_hz());
        r.damping_ratio.push_back((*next)->damping_ratio());
      }
      if (!r.frequency_hz.empty())
        decisions_.push_back(fmt::format("submodel of order {}: poles start at the modes {:.6g} Hz",
                                         r.shape.order, fmt::join(r.frequency_hz, ", ")));
    }
  }

  void place_real_pole(std::vector<SubmodelRequest>& requests, std::size_t i) {
    const double low = kBelowBand * frf_.frequency_hz[0];
    const double high = kAboveBand * frf_.frequency_hz[frf_.lines() - 1];
    std::vector<double>& f = requests[i].frequency_hz;
    f.push_back(low);
    double best = low;
    double least = std::numeric_limits<double>::infinity();
    for (int g = 0; g < kRealPoleGrid; ++g) {
      // Shifted per submodel, because real poles of two submodels must not start at the same value.
      const double shift = (static_cast<double>(g) + 0.1 * static_cast<double>(i)) / kRealPoleGrid;
      f.back() = low * std::pow(high / low, shift);
      const double cost = cost_at(requests);
      if (!(cost < least)) continue;
      least = cost;
      best = f.back();
    }
    f.back() = best;
    decisions_.push_back(fmt::format("submodel of order {}: its real pole starts at {:.4g} Hz",
                                     requests[i].shape.order, best));
  }

  /// Cost with solved numerators and poles at their start, without the submodels that have no start yet.
  double cost_at(const std::vector<SubmodelRequest>& requests) const {
    ModelStructure structure = common_;
    for (const SubmodelRequest& r : requests)
      if (r.frequency_hz.size() ==
          static_cast<std::size_t>(r.pairs() + (r.has_real_pole() ? 1 : 0)))
        structure.given.push_back(start_submodel(frf_, r));
    AdditiveModel model;
    model.submodels = fixed_submodels(frf_, structure);
    for (const ModeCandidate& mode : selection_.modes)
      model.submodels.push_back(mode_submodel(frf_, structure, mode));
    FitOptions options = quick_;
    options.max_iterations = 0;
    const FitResult fit = fit_additive_model(frf_, model, options);
    return fit.status() == FitStatus::singular ? std::numeric_limits<double>::infinity()
                                               : fit.model.fit.cost;
  }

  const FrfEstimate& frf_;
  ModelStructure common_;
  const ModeSelection& selection_;
  FitOptions quick_;
  std::vector<std::string>& decisions_;
  FitResult found_;
};

/// Lines that share their noise: with fewer for an independent one, deviations would change by less than a fifth.
constexpr double kAlike = 1.5;

ModelBlockResponse response_of(const FitResult& result, const FrfEstimate& frf) {
  return [&](const ResponseBlock& block) {
    return response(result.model, frf.frequency_hz.segment(block.first_line, block.lines),
                    result.model.hold, block.first_channel, block.channels);
  };
}

/// Why the residual is clearly larger than noise and known distortion, with advice; else nothing.
std::optional<FitReason> why_unexplained(const FrfEstimate& frf, const ResidualVerdict& verdict,
                                         const FitOptions& options, ModeNumber number,
                                         bool cut_short, const FitResult& result) {
  const bool by_weights = verdict.variance != ResidualVariance::total ||
                          (options.weighting != Weighting::noise_variance &&
                           options.weighting != Weighting::likelihood);
  if (verdict.explained && by_weights) return std::nullopt;
  if (verdict.explained)
    return FitReason{FitStatus::unexplained,
                     "the residual is explained by the scatter of the realizations, but not by the "
                     "noise used as weight",
                     "Use --weighting total_variance", "--weighting total_variance"};
  FitReason reason{FitStatus::unexplained, verdict.reason};
  if (!cut_short) reason = with_advice(std::move(reason), frf, options, result, number, false);
  if (reason.what == verdict.reason) reason.what += ": the model does not explain the data";
  return reason;
}

/// If the residual is less than half of what the variances predict.
std::string why_overestimated(const FrfEstimate& frf, const ResidualVerdict& verdict,
                              const FitResult& result) {
  const double free = 1.0 - static_cast<double>(result.parameters) /
                                (2.0 * static_cast<double>(frf.response.size()));
  const double ratio = verdict.chi_square / (verdict.expected * std::max(free, 0.0));
  if (!verdict.explained || !(ratio < 0.5)) return {};
  return fmt::format(
      "the residual is only {:.2g} of what the variances predict: they are too large, and the "
      "deviations are about {:.2g} times too large",
      ratio, 1.0 / std::sqrt(ratio));
}

/// The fit again, with the residual's lines counted as fewer independent ones if its noise is alike on neighbouring
/// lines: what looks like a mode then costs more, and all deviations are larger.
std::optional<FitResult> fit_with_fewer_lines(const FrfEstimate& frf,
                                              const RequestedStructure& structure,
                                              const ModeSelection& selection,
                                              const FitOptions& options, const FitResult& result) {
  if (!weighs_by_variance(options.weighting) || !options.uncertainty) return std::nullopt;
  const double correlated = lines_per_independent(
      frf, response_of(result, frf),
      options.weighting == Weighting::total_variance ? frf.total_variance : frf.noise_variance);
  if (correlated < kAlike * frf.correlated_lines) return std::nullopt;
  FrfEstimate counted = frf;
  counted.correlated_lines = correlated;
  FitResult again = structured_fit(counted, structure, selection, options);
  again.decisions.insert(again.decisions.begin(),
                         fmt::format("the noise is alike on neighbouring lines: of {:.3g} lines, "
                                     "one counts; deviations are {:.3g} times larger",
                                     correlated, std::sqrt(correlated)));
  return again;
}

}  // namespace

void check(const FrfEstimate& frf, const RequestedStructure& structure) {
  const auto require_faultless = [](const std::string& fault) {
    if (!fault.empty()) throw std::invalid_argument("submodel: " + fault);
  };
  for (const SubmodelRequest& r : structure.submodels) require_faultless(fault_of(r));
  require_faultless(
      fault_of(structure.submodels, structure.common.rigid_body, structure.common.direct_term));
  if (structure.suspension && structure.common.rigid_body)
    throw std::invalid_argument(
        "rigid body: a suspension replaces the rigid body; request only one of them");
  for (const double frequency_hz : structure.suspension_hz)
    if (!(frequency_hz > 0.0 && frequency_hz < frf.frequency_hz[0]))
      throw std::invalid_argument(
          fmt::format("rigid body: suspension at {} Hz; expected frequencies below the lowest "
                      "line, {} Hz",
                      frequency_hz, frf.frequency_hz[0]));
}

FitResult structured_fit(const FrfEstimate& frf, const RequestedStructure& structure,
                         const ModeSelection& selection, const FitOptions& asked) {
  check(frf);
  if (const auto [first, count] = frf.own();
      !frf.any(!frf.response.middleRows(first, count).isZero(0.0)))
    throw std::invalid_argument("fit: the response is zero on all lines; check the FRF");
  check(frf, structure);
  std::vector<std::string> decisions;
  ModelStructure complete = structure.common;
  if (structure.suspension) {
    complete.given = suspension_modes(frf, structure.suspension_hz);
    complete.open.rigid_body = false;
  }
  std::vector<SubmodelRequest> requests = structure.submodels;
  FitOptions options = asked;
  const bool order_is_searched = !requests.empty() && requests.front().order_by_search;
  options.limit = search_limit(
      order_is_searched ? ModeSelection{.modes = {}, .search_seconds = selection.search_seconds}
                        : selection,
      asked);
  PoleSearch(frf, complete, selection, options, decisions).complete(requests);
  for (const SubmodelRequest& r : requests) complete.given.push_back(start_submodel(frf, r));
  FitEvidence evidence;
  FitResult result = searched_fit(frf, complete, selection, options, evidence);
  options.delay = result.delay;
  result.decisions.insert(result.decisions.begin(), decisions.begin(), decisions.end());
  if (result.delay == DelayModel::per_channel && asked.delay != DelayModel::per_channel)
    evidence.late_channels = late_channels(result.model);
  // An interrupt between two fits has shortened the search as well.
  if (options.limit->was_interrupted() && !evidence.limit) {
    evidence.limit = FitReason{FitStatus::interrupted, options.limit->message()};
  }
  const ResidualVerdict residual = judge_residual(
      frf, response_of(result, frf), *options.user_weights, options.threads, {}, options.team);
  evidence.unexplained =
      why_unexplained(frf, residual, options, evidence.number,
                      evidence.limit.has_value() || ended_by_limit(result), result);
  evidence.overestimated = why_overestimated(frf, residual, result);
  if (!evidence.unexplained && !evidence.limit)
    if (std::optional<FitResult> again =
            fit_with_fewer_lines(frf, structure, selection, asked, result))
      return *std::move(again);
  judge(frf, evidence, result);
  if (options.uncertainty) fill_shape_deviations(frf, options, result);
  if (options.covariance) fill_covariance(frf, options, result);
  result.covariance_parts.reset();  // nobody needs them any more
  return result;
}

}  // namespace stageid
