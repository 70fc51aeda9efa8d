#include "frf/wiring/channel_change.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

namespace stageid {
namespace {

/// "a3", "a3 a7", "all sensors".
std::string channel_names(const ChannelChange& change, const LogInfo& info) {
  const ChannelList& list = change.of_sensors ? info.sensors : info.actuators;
  if (change.a < 0) return change.of_sensors ? "all sensors" : "all actuators";
  const std::string& a = list.name(change.a);
  return change.b < 0 ? a : a + " " + list.name(change.b);
}

/// A fault of the channels that to_finding() names.
Finding fault(Cause cause, std::string what, std::string figure, std::string remedy) {
  return {Severity::fault, cause, "", std::move(what), std::move(figure), std::move(remedy)};
}

Finding swap_finding(bool in_recording, bool of_sensors) {
  if (in_recording)
    return fault(
        Cause::swapped,
        "recorded under each other's name: u = r - C y is satisfied if the two are exchanged",
        "exchanged", "exchange the two names in the channel list of the recorder");
  return fault(
      Cause::swapped, "cables exchanged: the rigid body fits if the two are exchanged", "exchanged",
      of_sensors ? "exchange the two sensors' cables, or their positions in the stage file"
                 : "exchange the two amplifiers' cables, or their positions in the stage file");
}

Finding gain_finding(const ChannelChange& change, bool in_recording) {
  const double factor = std::abs(change.value);
  const char* where = in_recording ? "in the recording" : "at the stage";
  const std::string figure =
      fmt::format("factor {}", with_deviation(change.value, change.deviation, 3));
  if (change.value < 0.0 && std::abs(std::log(factor)) < std::log(1.3))
    return fault(Cause::sign, fmt::format("sign flipped {}", where), figure,
                 in_recording
                     ? "change the sign of the channel in the scaling of the recorder"
                     : "change the polarity of the channel, or its direction in the stage file");
  return fault(
      Cause::scale,
      fmt::format("{} {}", change.value < 0.0 ? "sign and scale wrong" : "scale wrong", where),
      figure,
      fmt::format("divide the channel by the factor; check its unit and {}",
                  in_recording ? "the scaling of the recorder"
                               : "its gain, or the mass in the stage file"));
}

Finding skew_finding(const ChannelChange& change, bool in_recording) {
  return fault(
      Cause::skew,
      fmt::format("{} {} than the other channels", in_recording ? "recorded" : "acts or samples",
                  change.value > 0.0 ? "later" : "earlier"),
      fmt::format("{} us", with_deviation(kMicroseconds * std::abs(change.value),
                                          kMicroseconds * change.deviation, 3)),
      in_recording ? "sample all channels simultaneously, or shift this one back"
                   : "sample all channels simultaneously, or fit with --delay per_channel");
}

}  // namespace

void undo(const ChannelChange& change, HealthRecord& record) {
  const Eigen::Index offset = change.of_sensors ? 0 : record.n_y();
  const Eigen::Index first = offset + std::max<Eigen::Index>(change.a, 0);
  const Eigen::Index count = change.a >= 0 ? 1 : change.of_sensors ? record.n_y() : record.n_u();
  for (std::size_t k = 0; k < record.lines.size(); ++k) {
    Eigen::MatrixXcd& Z = record.lines[k].Z;
    const double omega_rad_s =
        2.0 * std::numbers::pi * record.frequency_hz[static_cast<Eigen::Index>(k)];
    switch (change.kind) {
      case ChannelChange::Kind::gain:
        Z.middleRows(first, count) /= change.value;
        break;
      case ChannelChange::Kind::skew:
        Z.middleRows(first, count) *= std::polar(1.0, omega_rad_s * change.value);
        break;
      case ChannelChange::Kind::swap:
        Z.row(first).swap(Z.row(offset + change.b));
        break;
    }
  }
}

ChannelChange inverse(ChannelChange change) {
  if (change.kind == ChannelChange::Kind::gain) change.value = 1.0 / change.value;
  if (change.kind == ChannelChange::Kind::skew) change.value = -change.value;
  return change;
}

Finding to_finding(const ChannelChange& change, const LogInfo& info, bool in_recording) {
  using Kind = ChannelChange::Kind;
  Finding finding = change.kind == Kind::swap   ? swap_finding(in_recording, change.of_sensors)
                    : change.kind == Kind::gain ? gain_finding(change, in_recording)
                                                : skew_finding(change, in_recording);
  finding.channel = channel_names(change, info);
  return finding;
}

}  // namespace stageid
