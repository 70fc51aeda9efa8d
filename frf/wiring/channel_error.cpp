#include "frf/wiring/channel_error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace stageid {
namespace {

/// "a3", "a3 a7", "all sensors".
std::string channel_names(const ChannelError& error, const LogInfo& info) {
  const ChannelList& list = error.of_sensors ? info.sensors : info.actuators;
  if (error.a < 0) return error.of_sensors ? "all sensors" : "all actuators";
  const std::string& a = list.name(error.a);
  return error.b < 0 ? a : a + " " + list.name(error.b);
}

/// A fault of the channels that to_finding() names.
Finding fault(Cause cause, std::string what, std::string figure, std::string remedy) {
  return {Severity::fault, cause, "", std::move(what), std::move(figure), std::move(remedy)};
}

Finding swap_finding(bool in_recording, bool of_sensors) {
  if (in_recording)
    return fault(
        Cause::swapped,
        "recorded under each other's name: the records follow the control law only if the two are "
        "exchanged",
        "exchanged",
        "exchange the two names in the channel list of the recorder, and measure or import again");
  return fault(
      Cause::swapped, "cables exchanged: the rigid body fits if the two are exchanged", "exchanged",
      of_sensors ? "exchange the two sensors' cables, or their positions in the stage file"
                 : "exchange the two amplifiers' cables, or their positions in the stage file");
}

Finding gain_finding(const ChannelError& error, bool in_recording) {
  const double factor = std::abs(error.value);
  const char* where = in_recording ? "in the recording" : "at the stage";
  const std::string figure =
      fmt::format("factor {}", with_deviation(error.value, error.deviation, 3));
  if (error.value < 0.0 && std::abs(std::log(factor)) < std::log(1.3))
    return fault(Cause::sign, fmt::format("sign flipped {}", where), figure,
                 in_recording
                     ? "change the sign of the channel in the scaling of the recorder"
                     : "change the polarity of the channel, or its direction in the stage file");
  return fault(
      Cause::scale,
      fmt::format("{} {}", error.value < 0.0 ? "sign and scale wrong" : "scale wrong", where),
      figure,
      fmt::format("divide the channel by the factor; check its unit and {}",
                  in_recording ? "the scaling of the recorder"
                               : "its gain, or the mass in the stage file"));
}

Finding skew_finding(const ChannelError& error, bool in_recording) {
  return fault(
      Cause::skew,
      fmt::format("{} {} than the other channels", in_recording ? "recorded" : "acts or samples",
                  error.value > 0.0 ? "later" : "earlier"),
      fmt::format("{} us", with_deviation(kMicroseconds * std::abs(error.value),
                                          kMicroseconds * error.deviation, 3)),
      in_recording ? "sample all channels simultaneously, or shift this one back"
                   : "sample all channels simultaneously, or fit with --delay per_channel");
}

}  // namespace

void undo(const ChannelError& error, HealthRecord& record) {
  const Eigen::Index offset = error.of_sensors ? 0 : record.n_y();
  const Eigen::Index first = offset + std::max<Eigen::Index>(error.a, 0);
  const Eigen::Index count = error.a >= 0 ? 1 : error.of_sensors ? record.n_y() : record.n_u();
  for (std::size_t k = 0; k < record.lines.size(); ++k) {
    Eigen::MatrixXcd& Z = record.lines[k].Z;
    const double omega_rad_s = 2.0 * std::numbers::pi * record.frequency_hz[k];
    switch (error.kind) {
      case ChannelError::Kind::gain:
        Z.middleRows(first, count) /= error.value;
        break;
      case ChannelError::Kind::skew:
        Z.middleRows(first, count) *= std::polar(1.0, omega_rad_s * error.value);
        break;
      case ChannelError::Kind::swap:
        Z.row(first).swap(Z.row(offset + error.b));
        break;
    }
  }
}

ChannelError inverse(ChannelError error) {
  if (error.kind == ChannelError::Kind::gain) error.value = 1.0 / error.value;
  if (error.kind == ChannelError::Kind::skew) error.value = -error.value;
  return error;
}

Finding to_finding(const ChannelError& error, const LogInfo& info, bool in_recording) {
  using Kind = ChannelError::Kind;
  Finding finding = error.kind == Kind::swap   ? swap_finding(in_recording, error.of_sensors)
                    : error.kind == Kind::gain ? gain_finding(error, in_recording)
                                               : skew_finding(error, in_recording);
  finding.channel = channel_names(error, info);
  return finding;
}

}  // namespace stageid
