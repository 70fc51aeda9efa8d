#include "tools/workbench/model_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <sstream>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"

namespace stageid {
namespace {

/// Two numbers separated by a space, as in the flag; empty if they are missing.
std::optional<std::array<double, 2>> band_in(const Json& flags) {
  std::istringstream text(text_in(flags, "--band"));
  std::array<double, 2> band{};
  if (text >> band[0] >> band[1]) return band;
  return std::nullopt;
}

bool is_constant(const Eigen::VectorXd& delays) {
  return delays.size() == 0 || delays.isConstant(delays[0], 0.0);
}

}  // namespace

FitWords words_of_flags(const Json& flags) {
  FitWords words;
  const auto take = [&](const char* flag, std::string& word) {
    if (std::string text = text_in(flags, flag); !text.empty()) word = std::move(text);
  };
  take("--modes", words.modes);
  if (words.modes.find_first_not_of("0123456789.eE+-:,autone") != std::string::npos)
    words.modes.clear();
  take("--weighting", words.weighting);
  take("--hold", words.hold);
  take("--delay", words.delay);
  take("--rigid-body", words.rigid_body);
  take("--residue-rank", words.residue_rank);
  take("--damping", words.damping);
  take("--method", words.method);
  take("--direct-term", words.direct_term);
  if (const auto submodels = flags.find("--submodel"); submodels != flags.end())
    for (const Json& text : *submodels)
      if (text.is_string()) words.submodels.push_back(text.get<std::string>());
  return words;
}

FitRequest request_of(const AdditiveModel& model) {
  const auto provenance = parse_json_object<Json>(model.provenance_json);
  const Json options = provenance.value("options", Json::object());
  const Json flags = options.is_object() ? options.value("flags", Json::object()) : Json::object();
  FitRequest request;
  if (!flags.is_object()) return request;
  parse_fit_words(words_of_flags(flags), request);
  request.weight_file = request.weight_file.filename();  // a model cannot name files elsewhere
  request.band_hz = band_in(flags);
  if (const auto limit = number_in(options, "max_iterations"))
    request.max_iterations = static_cast<int>(std::clamp(*limit, 1.0, 1e6));
  if (const auto seconds = number_in(options, "search_seconds"))
    request.search_seconds = std::max(0.0, *seconds);
  return request;
}

ModeCandidate rounded_mode(double frequency_hz, double damping_ratio) {
  return {std::stod(fmt::format("{:.7g}", frequency_hz)),
          std::stod(fmt::format("{:.4g}", damping_ratio))};
}

FitRequest with_modes_of(const AdditiveModel& model, FitRequest request, double lowest_hz) {
  using Body = RigidBodyRequest::Kind;
  if (!request.submodels.empty())
    fail_request(
        "a model with requested submodels cannot be edited mode by mode; fit it without "
        "--submodel");
  const bool suspended = request.rigid_body.kind == Body::suspension;
  bool rigid = false;
  bool direct = false;
  bool general = false;
  request.modes = {ModesRequest::Kind::given, 0, {}};
  for (const Submodel& s : model.submodels) {
    rigid = rigid || s.integrators > 0;
    direct = direct || (s.integrators == 0 && s.order() == 0);
    if (!s.is_mode()) continue;
    general = general || s.numerator.size() > 1;
    const double frequency_hz = s.natural_frequency_hz();
    if (suspended && frequency_hz < lowest_hz) continue;
    request.modes.given.push_back(rounded_mode(frequency_hz, s.damping_ratio()));
  }
  std::ranges::stable_sort(request.modes.given, {}, &ModeCandidate::frequency_hz);
  if (request.modes.given.empty()) request.modes.kind = ModesRequest::Kind::none;
  if (request.rigid_body.kind == Body::automatic || request.rigid_body.kind == Body::by_submodels)
    request.rigid_body.kind = rigid ? Body::free : Body::none;
  if (!request.direct_term) request.direct_term = direct;
  if (!request.general_damping) request.general_damping = general;
  if (!request.delay && !(is_constant(model.input_delay_s) && is_constant(model.output_delay_s)))
    request.delay = DelayRequest{DelayModel::per_channel, 0.0};
  return request;
}

}  // namespace stageid
