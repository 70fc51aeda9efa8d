#include "estimation/request/request_flags.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string>
#include <vector>

#include "estimation/request/structure_request.hpp"
#include "estimation/request/submodel_text.hpp"

namespace stageid {

nlohmann::ordered_json flags_of(const FitRequest& request) {
  using Kind = ModesRequest::Kind;
  nlohmann::ordered_json flags = nlohmann::ordered_json::object();
  if (request.band_hz)
    flags["--band"] = fmt::format("{} {}", (*request.band_hz)[0], (*request.band_hz)[1]);
  if (request.modes.kind == Kind::search) flags["--modes"] = "auto";
  if (request.modes.kind == Kind::none) flags["--modes"] = "none";
  if (request.modes.kind == Kind::count) flags["--modes"] = fmt::format("{}", request.modes.count);
  if (request.modes.kind == Kind::given) {
    std::vector<std::string> modes;
    for (const ModeCandidate& mode : request.modes.given)
      modes.push_back(mode.damping_ratio == ModeCandidate{}.damping_ratio
                          ? fmt::format("{}", mode.frequency_hz)
                          : fmt::format("{}:{}", mode.frequency_hz, mode.damping_ratio));
    flags["--modes"] = fmt::format("{}{}", fmt::join(modes, ","), modes.size() == 1 ? "," : "");
  }
  if (request.weighting)
    flags["--weighting"] = *request.weighting == Weighting::user
                               ? request.weight_file.filename().string()
                               : to_string(*request.weighting);
  if (request.hold) flags["--hold"] = to_string(*request.hold);
  if (request.delay)
    flags["--delay"] = request.delay->model == DelayModel::fixed
                           ? fmt::format("{}", request.delay->delay_s)
                           : to_string(request.delay->model);
  if (request.rigid_body.kind != RigidBodyRequest::Kind::by_submodels)
    flags["--rigid-body"] = rigid_body_text(request);
  if (request.residue_rank > 0) flags["--residue-rank"] = fmt::format("{}", request.residue_rank);
  if (request.general_damping)
    flags["--damping"] = *request.general_damping ? "general" : "proportional";
  if (request.direct_term) flags["--direct-term"] = *request.direct_term ? "full" : "none";
  for (const SubmodelRequest& submodel : request.submodels)
    flags["--submodel"].push_back(submodel_text(submodel));
  const FitRequest usual;
  if (request.method != usual.method) flags["--method"] = to_string(request.method);
  if (request.max_iterations != usual.max_iterations)
    flags["--max-iterations"] = fmt::format("{}", request.max_iterations);
  if (request.search_seconds != usual.search_seconds)
    flags["--search-seconds"] = fmt::format("{}", request.search_seconds);
  return flags;
}

}  // namespace stageid
