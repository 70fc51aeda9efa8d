#include "hal/can/can_c_header.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <vector>

#include "hal/can/can_encoding.hpp"

namespace stageid {
namespace {

// Only what importers of C types support: macros, and named structures of numbers and arrays. Sizes are checked when the
// header is compiled. Members are aligned to their sizes: no packing is needed.
constexpr const char* kFrames = R"(/* A message over ZeroMQ. All numbers are little-endian. */
typedef struct {
  uint16_t id;
  uint16_t length;   /* used bytes of data */
  uint32_t reserved; /* 0 */
  uint8_t data[64];  /* a header of 8 bytes, then the payload */
} stageid_message;

typedef struct {
  uint16_t sequence;
  uint8_t kind;
  uint8_t run;
  uint16_t detail;
  uint16_t crc;
} stageid_header;

)";

constexpr const char* kTransfers = R"(/* Payload of 0x300 and 0x380. */
typedef struct {
  uint8_t bytes[56];
} stageid_chunk;

/* Payload of 0x381. */
typedef struct {
  uint8_t received[48];
} stageid_missing;

/* One sample of the trace memory. */
typedef struct {
  float actuators[STAGEID_ACTUATORS];
  float sensors[STAGEID_SENSORS];
  uint32_t outcome;
} stageid_trace_row;

extern char stageid_sizes_are_right[sizeof(stageid_message) == 72 && sizeof(stageid_header) == 8 &&
                                     sizeof(stageid_command) == 40 && sizeof(stageid_state) == 40 &&
                                     sizeof(stageid_trace_row) == 4 * (STAGEID_ACTUATORS + STAGEID_SENSORS + 1)
                                         ? 1 : -1];

#endif
)";

std::string structure(const char* name, std::span<const CanField> fields, const char* rest) {
  std::string text = "typedef struct {\n";
  for (const CanField& field : fields)
    text += fmt::format("  uint{}_t {};\n", 8 * field.bytes, field.name);
  return text + rest + fmt::format("}} stageid_{};\n\n", name);
}

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : "HUGE_VAL";
}

void add_channels(std::string& text, const char* kind, const std::vector<Channel>& channels,
                  const std::vector<CanScale>& scales, const Eigen::VectorXd& limits) {
  /// `/* s1 [m] */ 1e-3, ...`
  const auto add_table = [&](const char* of, const auto& value) {
    std::vector<std::string> entries;
    for (std::size_t i = 0; i < channels.size(); ++i)
      entries.push_back(
          fmt::format("/* {} [{}] */ {}", channels[i].name, channels[i].unit, value(i)));
    text += fmt::format("#define STAGEID_{}_{} {{ \\\n  {} }}\n", kind, of,
                        fmt::join(entries, ", \\\n  "));
  };
  add_table("NAMES", [&](std::size_t i) { return fmt::format("\"{}\"", channels[i].name); });
  add_table("LIMITS", [&](std::size_t i) { return number(limits[i]); });
  add_table("PER_COUNT", [&](std::size_t i) { return number(scales[i].si_per_count); });
}

}  // namespace

std::string can_c_header(const CanLayout& layout, const StageInfo& info,
                         const StageLimits& limits) {
  std::string text =
      "/* Written by 'stageid config header'. The protocol is described in docs/can-protocol.md. "
      "*/\n"
      "#ifndef STAGEID_STAGE_H\n#define STAGEID_STAGE_H\n\n#include <math.h>\n#include "
      "<stdint.h>\n\n";
  text += fmt::format("#define STAGEID_PROTOCOL_VERSION {}\n", kCanProtocolVersion);
  text += fmt::format("#define STAGEID_FINGERPRINT 0x{:08x}u\n", layout.fingerprint);
  text += fmt::format("#define STAGEID_SAMPLE_RATE_HZ {}\n", number(info.sample_rate_hz));
  text += fmt::format("#define STAGEID_ACTUATORS {}\n#define STAGEID_SENSORS {}\n\n",
                      info.actuators.size(), info.sensors.size());
  add_channels(text, "ACTUATOR", info.actuators, layout.actuator_scale, limits.actuator_n);
  add_channels(text, "SENSOR", info.sensors, layout.sensor_scale, limits.position_window_m);
  return text + "\n" + kFrames + "/* Payload of 0x080. */\n" +
         structure("command", kCanCommandFields, "  uint8_t reserved[7];\n") +
         "/* Payload of 0x200. */\n" + structure("state", kCanStateFields, "") + kTransfers;
}

}  // namespace stageid
