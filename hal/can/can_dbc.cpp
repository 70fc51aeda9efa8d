#include "hal/can/can_dbc.hpp"

#include <fmt/format.h>

#include <vector>

#include "hal/can/can_encoding.hpp"

namespace stageid {
namespace {

constexpr const char* kHead = R"(VERSION ""

NS_ :

BS_:

BU_: host node

)";

// 14: index of StandardCAN_FD in the enumeration.
constexpr const char* kAttributes =
    R"(BA_DEF_ "BusType" STRING ;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_DEF_ "BusType" "CAN FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN_FD";
BA_ "BusType" "CAN FD";
)";

/// One message; signals other than channels are unsigned little-endian.
class Message {
 public:
  Message(std::uint16_t id, const std::string& name, std::size_t payload_bytes, bool from_host)
      : id_(id), receiver_(from_host ? "node" : "host") {
    text_ =
        fmt::format("BO_ {} {}: {} {}\n", id, name, can_fd_length(kCanHeaderBytes + payload_bytes),
                    from_host ? "host" : "node");
  }
  Message& header(const char* kind, const char* detail) {
    integer("sequence", 0, 2);
    integer(kind, 2, 1);
    integer("run", 3, 1);
    integer(detail, 4, 2);
    return integer("crc", 6, 2);
  }
  Message& integer(const char* name, std::size_t at, std::size_t bytes) {
    text_ +=
        fmt::format(" SG_ {} : {}|{}@1+ (1,0) [0|0] \"\" {}\n", name, 8 * at, 8 * bytes, receiver_);
    return *this;
  }
  Message& channel(const Channel& channel, std::size_t at, const CanScale& scale) {
    const double range = kCanLargestCount * scale.si_per_count;
    text_ += fmt::format(" SG_ {} : {}|24@1- ({:.17g},0) [{:.9g}|{:.9g}] \"{}\" {}\n", channel.name,
                         8 * at, scale.si_per_count, -range, range, channel.unit, receiver_);
    return *this;
  }
  const std::string& text() const { return text_; }
  std::uint16_t id() const { return id_; }

 private:
  std::uint16_t id_;
  const char* receiver_;
  std::string text_;
};

Message values(const CanValueFrame& frame, std::size_t number, bool setpoint,
               const std::vector<CanScale>& scales, const std::vector<Channel>& channels) {
  Message message(frame.id, fmt::format("{}_{}", setpoint ? "setpoint" : "measurement", number),
                  frame.payload_bytes(), setpoint);
  message.header(setpoint ? "reserved" : "state", setpoint ? "tag" : "time_us");
  std::size_t at = kCanHeaderBytes;
  for (const std::size_t channel : frame.channels) {
    message.channel(channels[channel], at, scales[channel]);
    at += kCanCountBytes;
  }
  return message;
}

std::string state_names() {
  std::string text;
  for (int i = 0; i <= static_cast<int>(NodeState::fault); ++i)
    text += fmt::format(" {} \"{}\"", i, to_string(static_cast<NodeState>(i)));
  return text;
}

}  // namespace

std::string can_dbc(const CanLayout& layout, const StageInfo& info) {
  std::vector<Message> messages;
  messages.push_back(Message(kCanCommandId, "command", kCanCommandBytes, true)
                         .header("code", "reserved")
                         .integer("a", 8, 8)
                         .integer("b", 16, 8)
                         .integer("c", 24, 4)
                         .integer("d", 28, 4)
                         .integer("host", 32, 4)
                         .integer("session", 36, 4)
                         .integer("version", 40, 1));
  for (std::size_t i = 0; i < layout.setpoints.size(); ++i)
    messages.push_back(values(layout.setpoints[i], i, true, layout.actuator_scale, info.actuators));
  for (std::size_t i = 0; i < layout.sensors.size(); ++i)
    messages.push_back(values(layout.sensors[i], i, false, layout.sensor_scale, info.sensors));
  messages.push_back(Message(kCanStateId, "state", kCanStateBytes, false)
                         .header("state", "reserved")
                         .integer("version", 8, 1)
                         .integer("cause", 9, 1)
                         .integer("answer", 10, 1)
                         .integer("resident", 11, 1)
                         .integer("gaps", 12, 4)
                         .integer("repeated", 16, 4)
                         .integer("rejected", 20, 4)
                         .integer("sample", 24, 8)
                         .integer("fingerprint", 32, 4)
                         .integer("boot", 36, 4)
                         .integer("host", 40, 4)
                         .integer("session", 44, 4));
  messages.push_back(Message(kCanTextId, "text", kCanChunkBytes, false).header("reserved", "part"));
  messages.push_back(
      Message(kCanUploadId, "upload", kCanChunkBytes, true).header("chunk_high", "bytes"));
  messages.push_back(
      Message(kCanDownloadId, "download", kCanChunkBytes, false).header("chunk_high", "bytes"));
  messages.push_back(Message(kCanMissingId, "missing", 48, false).header("chunk_high", "reserved"));

  std::string text = kHead;
  for (const Message& message : messages) text += message.text() + "\n";
  text += kAttributes;
  for (const Message& message : messages)
    text += fmt::format("BA_ \"VFrameFormat\" BO_ {} 14;\n", message.id());
  text += fmt::format("VAL_ {} state{} ;\n", kCanStateId, state_names());
  return text;
}

}  // namespace stageid
