#include "hal/stage/peer_status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace stageid {
namespace {

using enum PeerStatus;
using enum PeerReaction;

constexpr PeerMeaning kMeanings[] = {
    {good, use, Outcome::ok, "no error"},
    {setpoints_missed, mark, Outcome::late, "the node has missed setpoints"},
    {late, mark, Outcome::late, "the sample is late"},
    {passive, mark, Outcome::bus_passive, "the bus is error-passive"},
    {incomplete, mark, Outcome::incomplete, "sensors have no value"},
    {nothing_new, mark, Outcome::stale, "there is no new measurement"},
    {damaged, mark, Outcome::corrupt, "the answer is damaged"},
    {out_of_range, stop, Outcome::limit, "a measurement exceeds the range of the link"},
    {limit, stop, Outcome::limit, "the node has stopped at a limit"},
    {not_measuring, stop, Outcome::fault, "the node stopped measuring"},
    {fault, stop, Outcome::fault, "the node reports a fault"},
    {unknown_code, stop, Outcome::fault, "the node sent an unknown code"},
    {conflict, stop, Outcome::fault,
     "two different answers to one sample: there is a second node or a forged frame"},
    {other_node, stop, Outcome::fault, "the node was restarted, or a second node answers instead"},
    {bus_off, stop, Outcome::bus_off, "the bus is off"},
    {link_down, stop, Outcome::link_down, "the link is down"},
    {first_sample_missing, refuse, Outcome::fault, "a sensor has no value before the run begins"},
    {held, refuse, Outcome::fault, "another host measures with this stage"},
    {in_fault, refuse, Outcome::fault, "the node is in fault"},
    {two_nodes, refuse, Outcome::fault, "two nodes answer"},
    {other_version, refuse, Outcome::fault, "the node has a different protocol version"},
    {other_stage, refuse, Outcome::fault, "the node was started with a different stage file"},
};

PeerStatus status_of_outcome(std::uint8_t code) noexcept {
  constexpr PeerStatus kOfCode[] = {good,    late,    incomplete, nothing_new, damaged,
                                    passive, bus_off, link_down,  fault,       limit};
  return code < std::size(kOfCode) ? kOfCode[code] : unknown_code;
}

PeerStatus status_of_state(NodeState state, FaultCause cause) noexcept {
  if (state > NodeState::fault) return unknown_code;
  if (cause == FaultCause::limit || cause == FaultCause::not_finite) return limit;
  if (cause != FaultCause::none) return fault;
  return state == NodeState::measuring ? good : not_measuring;
}

}  // namespace

std::span<const PeerMeaning> peer_meanings() noexcept { return kMeanings; }

const PeerMeaning& meaning(PeerStatus status) noexcept {
  return kMeanings[static_cast<std::size_t>(status)];
}

PeerStatus judge(const PeerReport& report) noexcept {
  PeerStatus worst =
      std::max(status_of_outcome(report.outcome), status_of_state(report.state, report.cause));
  if (report.setpoints_missed) worst = std::max(worst, setpoints_missed);
  if ((report.valid & report.all) != report.all) worst = std::max(worst, incomplete);
  if ((report.valid & report.all) == 0) worst = std::max(worst, nothing_new);
  if (report.out_of_range) worst = std::max(worst, out_of_range);
  return worst;
}

Outcome outcome_of_code(std::uint8_t code) noexcept {
  return meaning(status_of_outcome(code)).outcome;
}

void refuse(PeerStatus status, const std::string& place, const std::string& detail) {
  throw StageError(fmt::format("{}: {}{}", place, meaning(status).words, detail));
}

}  // namespace stageid
