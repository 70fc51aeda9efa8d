#include "estimation/request/fit_request.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "estimation/request/request_flags.hpp"
#include "estimation/request/structure_request.hpp"
#include "estimation/request/submodel_text.hpp"
#include "estimation/request/weight_file.hpp"
#include "estimation/search/trials.hpp"
#include "frf/response/channel_tiles.hpp"
#include "frf/response/dc_line.hpp"
#include "frf/response/hold_compensation.hpp"
#include "frf/response/neighbour_scatter.hpp"
#include "frf/response/nonlinearity.hpp"
#include "frf/response/nonlinearity_sentence.hpp"

namespace stageid {
namespace {

/// Note on channels whose weight is zero on all lines; empty if there are none.
std::string channels_without_weight(const FrfEstimate& frf, const FitOptions& options) {
  const Eigen::MatrixXd& W = options.user_weights;
  std::vector<std::string> names;
  for (Eigen::Index c = 0; c < W.rows(); ++c)
    if (W.row(c).maxCoeff() == 0.0)
      names.push_back(fmt::format("({}, {})", frf.outputs.names[c % frf.n_outputs()],
                                  frf.inputs.names[c / frf.n_outputs()]));
  if (names.empty()) return {};
  return fmt::format(
      "weighting: {} (output, input) {} zero weight: free numerators there are undetermined; they "
      "are written as 0 with a standard deviation of null",
      fmt::join(names, ", "), names.size() == 1 ? "has" : "have");
}

/// Defaults that depend on the FRF.
class FitDefaults {
 public:
  FitDefaults(const FitRequest& request, FitSetup& setup, WholeLines whole)
      : request_(request), setup_(setup), whole_(whole) {}

  /// Restores removed delay and hold in the data and adds them to the model, which treats hold, delay and sampler
  /// exactly. The data still contain the aliasing, which no compensation can remove.
  void restore_as_measured() {
    FrfEstimate& frf = setup_.frf;
    const bool only_delay = frf.compensated == Compensation::delay;
    const HoldModel hold = request_.hold.value_or(HoldModel::exact);
    const bool wanted = hold == HoldModel::exact || (only_delay && hold != HoldModel::none);
    if (frf.compensated == Compensation::none || !(frf.sample_rate_hz > 0.0) || !wanted) return;
    known_delay_s_ = frf.delay_s;
    frf = as_measured(std::move(frf));
    note(
        fmt::format("hold and delay: the response was compensated for a delay of {} s; the "
                    "compensation is undone and the delay modelled",
                    *known_delay_s_));
  }

  void choose_hold() {
    const bool held = setup_.frf.hold == Hold::zoh;
    setup_.options.hold = request_.hold.value_or(held ? HoldModel::exact : HoldModel::none);
    if (request_.hold) return;
    note(held ? "hold: exact, the response was measured through a zero-order hold"
              : "hold: none, the response is that of a continuous-time plant");
  }

  void choose_delay() {
    FitOptions& options = setup_.options;
    const FrfEstimate& frf = setup_.frf;
    if (request_.delay) {
      take_delay(*request_.delay);
    } else if (known_delay_s_) {
      options.delay_s = *known_delay_s_;
    } else if (frf.hold == Hold::zoh && options.hold != HoldModel::none) {
      options.delay = DelayModel::estimate;
      note("delay: estimated, one for the plant");
    } else {
      note("delay: none");
    }
  }

  void choose_weighting() {
    FitOptions& options = setup_.options;
    const FrfEstimate& frf = setup_.frf;
    if (request_.weighting) {
      take_weighting(*request_.weighting);
      return;
    }
    if (weigh_by_scatter() || weigh_by_realizations()) return;
    options.weighting = frf.noise_variance.size() > 0   ? Weighting::noise_variance
                        : frf.total_variance.size() > 0 ? Weighting::total_variance
                                                        : Weighting::relative;
    note(fmt::format(
        "weighting: {}{}", to_string(options.weighting),
        options.weighting == Weighting::relative ? ", the response has no variances" : ""));
  }

  /// Rejected here, because the fit would grow for hours towards a number that the lines do not support.
  void require_affordable_modes() const {
    const Eigen::Index lines = setup_.frf.lines();
    const Eigen::Index most = most_modes(setup_.frf, setup_.structure.common);
    if (setup_.selection.exactly > most)
      fail_request("modes: {} is too many; {} lines support at most {}; use fewer or a wider band",
                   setup_.selection.exactly, lines, most);
  }

  void choose_modes() {
    using Kind = ModesRequest::Kind;
    ModeSelection& selection = setup_.selection;
    switch (modes_kind(request_)) {
      case Kind::none:
        selection.keep_modes = true;
        return;
      case Kind::count:
        if (request_.modes.count < 1 || request_.modes.count > 1000)
          fail_request("modes: got {}; expected 1 to 1000 modes", request_.modes.count);
        selection.exactly = request_.modes.count;
        return;
      case Kind::given:
        for (const ModeCandidate& mode : request_.modes.given) {
          if (!(mode.frequency_hz > 0.0))
            fail_request("modes: got {} Hz; expected positive frequencies", mode.frequency_hz);
          require_below_nyquist("modes", setup_, mode.frequency_hz);
        }
        selection.modes = request_.modes.given;
        selection.keep_modes = true;
        return;
      default:
        return;
    }
  }

 private:
  void note(std::string text) { setup_.notes.push_back(std::move(text)); }
  void warn(const std::string& text) {
    setup_.warnings.push_back(text);
    note(text);
  }

  void take_delay(const DelayRequest& delay) {
    FitOptions& options = setup_.options;
    options.delay = delay.model;
    if (delay.model != DelayModel::fixed) return;
    options.delay_s = delay.delay_s;
    const Eigen::VectorXd& f = setup_.frf.frequency_hz;
    if (f.size() < 2) return;
    const double spacing_hz = (f.tail(f.size() - 1) - f.head(f.size() - 1)).minCoeff();
    if (!(std::abs(delay.delay_s) * 2.0 * spacing_hz <= 1.0))
      fail_request(
          "delay: got {} s; expected a magnitude of at most {:.4g} s: lines {:.4g} Hz "
          "apart cannot resolve a longer delay (1/(2 df))",
          delay.delay_s, 0.5 / spacing_hz, spacing_hz);
  }

  /// The scatter of neighbouring lines, where the variance is unknown, or where that by periods does not include
  /// nonlinear distortion, because there is one realization: modes would fit the distortion. @returns whether it is used
  bool weigh_by_scatter() {
    FrfEstimate& frf = setup_.frf;
    const bool unknown = frf.noise_variance.size() == 0;
    if (unknown ? frf.total_variance.size() > 0 : frf.realizations > 1) return false;
    // The median of some channels is that of many; the scatter of all takes as long as a fit.
    if (!unknown && channel_tiles(frf.response.rows()) > 1 &&
        !line_scatter(some_channels(frf), request_.threads).shows_distortion())
      return false;
    LineScatter scatter = line_scatter(frf, request_.threads);
    if (unknown ? scatter.variance.size() == 0 : !scatter.shows_distortion()) return false;
    if (lines_are_coarse(frf, scatter, request_.threads)) {
      if (!unknown)
        warn(
            "weighting by period-to-period variance. The line-to-line scatter is larger, but the "
            "lines are too coarse to separate distortion from resonances: halve the spacing or "
            "measure several realizations");
      return false;
    }
    frf.total_variance = std::move(scatter.variance);
    frf.total_dof = scatter.dof;
    setup_.options.weighting = Weighting::total_variance;
    if (unknown) {
      note("weighting: the scatter of neighbouring lines, the response has no variances");
      return true;
    }
    warn(fmt::format(
        "weighting by the scatter of neighbouring lines, {:.3g} times the period-to-period "
        "variance (median): the plant appears nonlinear, and one realization is too few to measure "
        "the distortion; measure several realizations",
        scatter.over_noise));
    return true;
  }

  /// Distortion changes an estimate from realization to realization as noise does, but the periods do not show it.
  /// They do not show a transient or a drift either, and then linearity cannot be tested.
  bool weigh_by_realizations() {
    FrfEstimate& frf = setup_.frf;
    if (!why_linearity_cannot_be_tested(frf).empty()) return false;
    const bool differ = nonlinearity_test(frf).nonlinear();
    frf.nonlinearity = linearity_of(frf);
    const std::string nonlinear = nonlinearity_sentence(frf);
    if (nonlinear.empty() && !differ) return false;
    weigh_by_total_variance();
    warn("weighting: total_variance; " +
         (!nonlinear.empty() ? nonlinear
          : is_withdrawn(frf.nonlinearity)
              ? "realizations differ by more than their periods; the data health names the cause"
              : "realizations differ by more than their periods, because of a transient or a "
                "drift: increase transient_periods or realizations"));
    return true;
  }

  void weigh_by_total_variance() {
    FrfEstimate& frf = setup_.frf;
    setup_.options.weighting = Weighting::total_variance;
    if (frf.noise_variance.size() == 0 || !(frf.total_dof >= 1.0)) return;
    DistortionVariance distorted = distortion_variance(frf);
    setup_.distortion = std::move(distorted.distortion);
    if (frf.residual_covariance.size() > 0)
      frf.residual_covariance = covariance_with_distortion(frf, distorted.variance);
    frf.total_variance = std::move(distorted.variance);
    frf.total_dof = distorted.dof;
  }

  void take_weighting(Weighting weighting) {
    FitOptions& options = setup_.options;
    options.weighting = weighting;
    if (weighting == Weighting::total_variance) weigh_by_total_variance();
    if (weighting != Weighting::user) return;
    read_weights(request_.weight_file, setup_.frf, options, whole_);
    const std::string missing = channels_without_weight(setup_.frf, options);
    if (missing.empty()) return;
    warn(missing);
  }

  const FitRequest& request_;
  FitSetup& setup_;
  WholeLines whole_;
  std::optional<double> known_delay_s_;
};

bool is_acceleration(const std::string& unit) {
  return unit == "g" || unit.ends_with("/s^2") || unit.ends_with("/s2") || unit.ends_with("/s²") ||
         unit.ends_with(" s^-2");
}

/// The unset parts of the structure, chosen by the quantity of the outputs.
FitRequest with_structure(FitRequest request, const FrfEstimate& frf,
                          std::vector<std::string>& notes) {
  const std::vector<std::string>& units = frf.outputs.units;
  const bool any_rank = request.residue_rank <= 1;
  const bool accelerations = !units.empty() && std::ranges::all_of(units, is_acceleration) &&
                             request.submodels.empty() && any_rank;
  const bool silent = !request.general_damping && !request.direct_term &&
                      request.rigid_body.kind == RigidBodyRequest::Kind::by_submodels;
  if (!accelerations || !silent) return request;
  notes.push_back(
      fmt::format("structure: numerators B_0 + B_1 s, a direct term and no rigid body, because the "
                  "outputs are accelerations [{}]",
                  units.front()));
  request.general_damping = request.direct_term = true;
  request.rigid_body.kind = RigidBodyRequest::Kind::none;
  return request;
}

/// Keys and words as on the command line, because model.json contains the request.
std::string provenance_of(const FitRequest& request, const FitSetup& setup) {
  using Json = nlohmann::ordered_json;
  const FitOptions& o = setup.options;
  const ModelStructure& structure = setup.structure.common;
  const OpenStructure& open = structure.open;
  Json modes = modes_kind(request) == ModesRequest::Kind::none ? "none" : "auto";
  if (setup.selection.exactly > 0) modes = fmt::format("{}", setup.selection.exactly);
  if (!setup.selection.modes.empty()) {
    modes = Json::array();
    for (const ModeCandidate& mode : setup.selection.modes) modes.push_back(mode.frequency_hz);
  }
  Json json = {
      {"band_hz", {setup.frf.frequency_hz[0], setup.frf.frequency_hz[setup.frf.lines() - 1]}},
      {"modes", modes},
      {"weighting", to_string(o.weighting)},
      {"hold", to_string(o.hold)},
      {"delay", o.delay == DelayModel::fixed ? Json(o.delay_s) : Json(to_string(o.delay))},
      {"rigid_body", rigid_body_text(request)},
      {"residue_rank",
       request.residue_rank == 0 ? "full" : fmt::format("{}", request.residue_rank)},
      {"direct_term", open.direct_term        ? "auto"
                      : structure.direct_term ? "full"
                                              : "none"},
      {"damping", open.general_damping        ? "auto"
                  : structure.general_damping ? "general"
                                              : "proportional"},
      {"method", to_string(request.method)},
      {"max_iterations", o.max_iterations},
      {"search_seconds", request.search_seconds}};
  for (const SubmodelRequest& submodel : request.submodels)
    json["submodels"].push_back(submodel_text(submodel));
  if (o.weighting == Weighting::user) {
    Fingerprint fingerprint;
    const auto add = [&](const auto& matrix) {
      const auto* bytes = reinterpret_cast<const std::byte*>(matrix.data());
      fingerprint.add({bytes, static_cast<std::size_t>(matrix.size()) * sizeof(*matrix.data())});
    };
    add(*o.user_weights);
    add(o.user_weight_matrices);
    json["weights_fingerprint"] = fingerprint.hex();
  }
  json["flags"] = flags_of(request);
  return json.dump();
}

}  // namespace

FitSetup make_fit_setup(const FitRequest& asked, FrfEstimate frf) {
  FitSetup setup;
  const FitRequest request = with_structure(asked, frf, setup.notes);
  const Eigen::VectorXd whole_hz = frf.frequency_hz;
  if (request.band_hz)
    frf = select_band(std::move(frf), (*request.band_hz)[0], (*request.band_hz)[1]);
  if (has_dc_line(frf)) {
    setup.warnings.emplace_back(kDcLineLeftOut);
    setup.notes.emplace_back(kDcLineLeftOut);
    frf = without_dc_line(std::move(frf));
  }
  setup.frf = std::move(frf);
  const auto before = (whole_hz.array() < setup.frf.frequency_hz[0]).count();
  FitDefaults defaults(request, setup, {before, whole_hz.size()});
  defaults.restore_as_measured();
  defaults.choose_hold();
  defaults.choose_delay();
  defaults.choose_weighting();
  defaults.choose_modes();
  choose_structure(request, setup);
  defaults.require_affordable_modes();
  setup.options.method = request.method;
  if (request.max_iterations < 1)
    fail_request("max_iterations: got {}; expected 1 or more", request.max_iterations);
  setup.options.max_iterations = request.max_iterations;
  if (!(request.search_seconds >= 0.0))
    fail_request("search_seconds: got {}; expected 0 or more", request.search_seconds);
  setup.selection.search_seconds = request.search_seconds;
  setup.options.threads = request.threads;
  setup.request_json = provenance_of(request, setup);
  return setup;
}

FitResult fit_model(FrfEstimate frf, const FitRequest& request) {
  const FitSetup setup = make_fit_setup(request, std::move(frf));
  return fit_model(setup, setup.options);
}

FitResult fit_model(const FitSetup& setup, const FitOptions& options) {
  FitResult result = structured_fit(setup.frf, setup.structure, setup.selection, options);
  result.decisions.insert(result.decisions.begin(), setup.notes.begin(), setup.notes.end());
  return result;
}

}  // namespace stageid
