#include "tools/fit/structure_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "acquisition/files/key_suggestion.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/fit/submodel_text.hpp"

namespace stageid {
namespace {

constexpr std::string_view kSuspension = "suspension";
constexpr const char* kRigidBodies =
    "auto, none, full, a rank of 1 or more, suspension, or suspension:F1:F2 (Hz)";

int rank(const char* flag, const std::string& text, const char* allowed) {
  const std::optional<double> number = to_number(text);
  if (!number || *number < 1.0 || *number > 1000.0 || std::floor(*number) != *number)
    refuse(flag, text, allowed);
  return static_cast<int>(*number);
}

/// Real parts of phi psi^T, see ResidueForm.
bool takes_rank(const SubmodelRequest& submodel, int residue_rank) {
  const auto [l, n, m] = submodel.shape;
  if (n == 0 && !submodel.order_by_search) return true;  // it stays free
  return n == 2 && l == 0 && (m == 0 || (m == 1 && residue_rank == 1));
}

void parse_suspension(const std::string& text, FitSetup& setup) {
  RequestedStructure& structure = setup.structure;
  structure.suspension = true;
  const double lowest_hz = setup.frf.frequency_hz[0];
  std::string_view rest = std::string_view(text).substr(kSuspension.size());
  while (!rest.empty()) {
    const std::size_t colon = rest[0] == ':' ? std::min(rest.find(':', 1), rest.size()) : 0;
    const std::optional<double> frequency_hz =
        colon > 0 ? to_number(rest.substr(1, colon - 1)) : std::nullopt;
    if (!frequency_hz || *frequency_hz <= 0.0 || *frequency_hz >= lowest_hz)
      refuse("--rigid-body", text,
             fmt::format("suspension, or suspension:F1:F2 with known frequencies below the lowest "
                         "line, {} Hz",
                         lowest_hz));
    structure.suspension_hz.push_back(*frequency_hz);
    rest.remove_prefix(colon);
  }
}

void choose_submodels(const FitRequest& request, FitSetup& setup) {
  RequestedStructure& structure = setup.structure;
  structure.submodels = request.submodels;
  for (const SubmodelRequest& submodel : structure.submodels) {
    if (const std::string fault = fault_of(submodel); !fault.empty())
      refuse("--submodel", submodel_text(submodel), fault);
    for (const double frequency_hz : submodel.frequency_hz)
      require_below_nyquist("--submodel", setup, frequency_hz);
  }
  const std::string fault =
      fault_of(structure.submodels, structure.common.rigid_body, structure.common.direct_term);
  if (!fault.empty()) throw std::invalid_argument("--submodel: " + fault);
  const bool nothing = structure.submodels.empty() && !structure.suspension &&
                       !structure.common.rigid_body && !structure.common.direct_term;
  if (requested_modes(request) == "none" && nothing)
    refuse("--modes", "none", "at least one of modes, a rigid body, a direct term and a submodel");
}

void choose_rigid_body(const FitRequest& request, FitSetup& setup) {
  const std::string text = requested_rigid_body(request);
  setup.structure.common.rigid_body = false;
  if (text == "none") return;
  if (text.starts_with(kSuspension)) {
    parse_suspension(text, setup);
    return;
  }
  setup.structure.common.rigid_body = true;
  setup.structure.springs_if_worth = text == "auto";
  if (text == "auto" || text == "full") return;
  const std::string word = text.substr(0, text.find(':'));
  const std::string nearest =
      nearest_word(word, {"auto", "none", "full", std::string(kSuspension)});
  if (!to_number(text) && !nearest.empty())
    refuse("--rigid-body", text, fmt::format("{} (did you mean '{}'?)", kRigidBodies, nearest));
  setup.options.rigid_body_rank = rank("--rigid-body", text, kRigidBodies);
}

void choose_residue_rank(const FitRequest& request, FitSetup& setup) {
  setup.options.residue_rank =
      request.residue_rank == "full"
          ? 0
          : rank("--residue-rank", request.residue_rank, "full or a rank of 1 or more");
  if (setup.structure.common.general_damping && setup.options.residue_rank > 1)
    refuse("--residue-rank", request.residue_rank, "full or 1 with --damping general");
  if (setup.options.residue_rank == 0) return;
  for (const SubmodelRequest& submodel : request.submodels)
    if (!takes_rank(submodel, setup.options.residue_rank))
      refuse("--residue-rank", request.residue_rank,
             fmt::format("full: a rank applies to modes only (n=2 with m=0, or m=1 and rank 1), "
                         "not to --submodel {}",
                         submodel_text(submodel)));
}

/// Where nothing is said, submodels that are asked for stand alone.
std::string by_submodels(const FitRequest& request, const std::string& given,
                         const char* otherwise) {
  if (!given.empty()) return given;
  return request.submodels.empty() ? otherwise : "none";
}

}  // namespace

std::string requested_modes(const FitRequest& request) {
  return by_submodels(request, request.modes, "auto");
}

std::string requested_rigid_body(const FitRequest& request) {
  return by_submodels(request, request.rigid_body, "auto");
}

void choose_structure(const FitRequest& request, FitSetup& setup) {
  ModelStructure& common = setup.structure.common;
  common.direct_term = pick<int>("--direct-term", request.direct_term, {"none", "full"}) == 1;
  common.general_damping =
      pick<int>("--damping", request.damping, {"proportional", "general"}) == 1;
  choose_rigid_body(request, setup);
  choose_residue_rank(request, setup);
  choose_submodels(request, setup);
}

void require_below_nyquist(const char* flag, const FitSetup& setup, double frequency_hz) {
  const double nyquist_hz = 0.5 * setup.frf.sample_rate_hz;
  if (nyquist_hz > 0.0 && setup.options.hold != HoldModel::none && frequency_hz >= nyquist_hz)
    throw std::invalid_argument(
        fmt::format("{}: {} Hz is not below half the sample rate, {} Hz; use lower frequencies",
                    flag, frequency_hz, nyquist_hz));
}

}  // namespace stageid
