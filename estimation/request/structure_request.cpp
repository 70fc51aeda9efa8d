#include "estimation/request/structure_request.hpp"

#include <fmt/format.h>

#include "acquisition/files/fail.hpp"
#include "estimation/request/submodel_text.hpp"

namespace stageid {
namespace {

/// Real parts of phi psi^T, see ResidueForm.
bool takes_rank(const SubmodelRequest& submodel, int residue_rank) {
  const auto [l, n, m] = submodel.shape;
  if (n == 0 && !submodel.order_by_search) return true;  // it remains free
  return n == 2 && l == 0 && (m == 0 || (m == 1 && residue_rank == 1));
}

void choose_submodels(const FitRequest& request, FitSetup& setup) {
  RequestedStructure& structure = setup.structure;
  structure.submodels = request.submodels;
  check(setup.frf, structure);
  for (const SubmodelRequest& submodel : structure.submodels)
    for (const double frequency_hz : submodel.frequency_hz)
      require_below_nyquist("submodel", setup, frequency_hz);
  const bool nothing = structure.submodels.empty() && !structure.suspension &&
                       !structure.common.rigid_body && !structure.common.direct_term;
  if (modes_kind(request) == ModesRequest::Kind::none && nothing)
    fail_request(
        "modes: got none; expected at least one of modes, a rigid body, a direct term and a "
        "submodel");
}

void choose_rigid_body(const FitRequest& request, FitSetup& setup) {
  using Kind = RigidBodyRequest::Kind;
  RequestedStructure& structure = setup.structure;
  const Kind kind = rigid_body_kind(request);
  structure.common.rigid_body = kind == Kind::automatic || kind == Kind::free;
  structure.suspension = kind == Kind::suspension;
  if (kind == Kind::free) setup.options.rigid_body_rank = request.rigid_body.rank;
  if (kind == Kind::suspension) structure.suspension_hz = request.rigid_body.suspension_hz;
}

void choose_residue_rank(const FitRequest& request, FitSetup& setup) {
  const int rank = request.residue_rank;
  setup.options.residue_rank = rank;
  if (rank < 0)
    fail_request("residue rank: got {}; expected 0 (full) or a rank of 1 or more", rank);
  if (setup.structure.common.general_damping && rank > 1)
    fail_request("residue rank: got {}; expected full or 1 with general damping", rank);
  if (rank == 0) return;
  for (const SubmodelRequest& submodel : request.submodels)
    if (!takes_rank(submodel, rank))
      fail_request(
          "residue rank: got {}; expected full: a rank applies to modes only (n=2 with "
          "m=0, or m=1 and rank 1), not to submodel {}",
          rank, submodel_text(submodel));
}

}  // namespace

ModesRequest::Kind modes_kind(const FitRequest& request) noexcept {
  using Kind = ModesRequest::Kind;
  if (request.modes.kind != Kind::by_submodels) return request.modes.kind;
  return request.submodels.empty() ? Kind::search : Kind::none;
}

RigidBodyRequest::Kind rigid_body_kind(const FitRequest& request) noexcept {
  using Kind = RigidBodyRequest::Kind;
  if (request.rigid_body.kind != Kind::by_submodels) return request.rigid_body.kind;
  return request.submodels.empty() ? Kind::automatic : Kind::none;
}

std::string rigid_body_text(const FitRequest& request) {
  const RigidBodyRequest& body = request.rigid_body;
  if (body.rank > 0) return fmt::format("{}", body.rank);
  std::string text = to_string(rigid_body_kind(request));
  for (const double frequency_hz : body.suspension_hz) text += fmt::format(":{}", frequency_hz);
  return text;
}

void choose_structure(const FitRequest& request, FitSetup& setup) {
  setup.structure.common.direct_term = request.direct_term.value_or(false);
  setup.structure.common.general_damping = request.general_damping.value_or(false);
  choose_rigid_body(request, setup);
  if (request.submodels.empty())
    setup.structure.common.open = {
        .rigid_body = rigid_body_kind(request) == RigidBodyRequest::Kind::automatic,
        .direct_term = !request.direct_term,
        .general_damping = !request.general_damping && request.residue_rank <= 1,
        .delay = !request.delay && setup.options.hold != HoldModel::none};
  choose_residue_rank(request, setup);
  choose_submodels(request, setup);
}

void require_below_nyquist(const char* member, const FitSetup& setup, double frequency_hz) {
  const double nyquist_hz = 0.5 * setup.frf.sample_rate_hz;
  if (nyquist_hz > 0.0 && setup.options.hold != HoldModel::none && frequency_hz >= nyquist_hz)
    fail_request("{}: {} Hz is not below half the sample rate, {} Hz; use lower frequencies",
                 member, frequency_hz, nyquist_hz);
}

}  // namespace stageid
