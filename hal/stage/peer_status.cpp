#include "hal/stage/peer_status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace stageid {
namespace {

using enum PeerStatus;
using enum PeerReaction;

constexpr PeerMeaning kMeanings[] = {
    {good, use, Outcome::ok, "no error", "a measurement in state measuring",
     "outcome 0 in state measuring"},
    {setpoints_missed, mark, Outcome::late, "the node has missed setpoints",
     "`gaps` in the state exceeds the samples that the host has marked",
     "the count of missed setpoints increased"},
    {late, mark, Outcome::late, "the sample is late", "the answer arrives after the deadline",
     "outcome 1, or the reply arrived at the second attempt"},
    {passive, mark, Outcome::bus_passive, "the bus is error-passive", "error frames", "outcome 5"},
    {incomplete, mark, Outcome::incomplete, "sensors have no value",
     "no-value codes or missing frames", "some bits of `valid` are 0, or outcome 2"},
    {nothing_new, mark, Outcome::stale, "there is no new measurement",
     "no answer, or no-value codes only", "`valid` = 0, or outcome 3"},
    {damaged, mark, Outcome::corrupt, "the answer is damaged", "wrong CRC or length",
     "wrong CRC, length or sequence twice, or outcome 4"},
    {out_of_range, stop, Outcome::limit, "a measurement exceeds the range of the link",
     "bit 7 of `kind` in a measurement", "a count of +-(2^31 - 1)"},
    {limit, stop, Outcome::limit, "the node has stopped at a limit", "state with cause 2 or 3",
     "outcome 9, or cause 2 or 3"},
    {not_measuring, stop, Outcome::fault, "the node stopped measuring",
     "any other state in `kind` or in a state frame", "any other state"},
    {fault, stop, Outcome::fault, "the node reports a fault", "state with any other cause",
     "outcome 8, or any other cause"},
    {unknown_code, stop, Outcome::fault, "the node sent an unknown code", "a state above 8",
     "an outcome above 9 or a state above 8"},
    {conflict, stop, Outcome::fault,
     "two different answers to one sample: there is a second node or a forged frame",
     "two different frames with one sequence", "-"},
    {other_node, stop, Outcome::fault, "the node was restarted, or a second node answers instead",
     "a state with a different `boot`", "a different `measurement_boot_id`"},
    {bus_off, stop, Outcome::bus_off, "the bus is off", "error frames", "outcome 6"},
    {link_down, stop, Outcome::link_down, "the link is down", "the interface is down",
     "no reply twice, the connection ends, or outcome 7"},
    {first_sample_missing, refuse, Outcome::fault, "a sensor has no value before the run begins",
     "no-value codes in y[0]", "a bit of `valid` is 0 in y[0]"},
    {held, refuse, Outcome::fault, "another host measures with this stage",
     "the node refuses start or arm", "exception 6 at the start of a run"},
    {in_fault, refuse, Outcome::fault, "the node is in fault", "state 7 or 8", "state 7 or 8"},
    {two_nodes, refuse, Outcome::fault, "two nodes answer", "two answers to one hello", "-"},
    {other_version, refuse, Outcome::fault, "the node has a different protocol version",
     "a different `version`", "a different `map_version`"},
    {other_stage, refuse, Outcome::fault, "the node was started with a different stage file",
     "a different `fingerprint`", "different channels, sample rate or `channel_hash`"},
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

std::string peer_meanings_table() {
  std::string table =
      "| status | over CAN FD | over Modbus | reaction | outcome |\n"
      "| --- | --- | --- | --- | --- |\n";
  for (const PeerMeaning& m : kMeanings)
    fmt::format_to(std::back_inserter(table), "| {} | {} | {} | {} | {} |\n", m.words, m.can,
                   m.modbus, to_string(m.reaction),
                   m.reaction == PeerReaction::refuse ? "-" : to_string(m.outcome));
  return table;
}

}  // namespace stageid
