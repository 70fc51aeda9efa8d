#include "hal/can/can_dbc.hpp"

#include <fmt/format.h>

#include <span>
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
  Message(std::uint16_t id, const std::string& name, std::size_t payload_bytes, bool from_host,
          const char* kind, const char* detail)
      : id_(id), receiver_(from_host ? "node" : "host") {
    text_ =
        fmt::format("BO_ {} {}: {} {}\n", id, name, can_fd_length(kCanHeaderBytes + payload_bytes),
                    from_host ? "host" : "node");
    for (const CanField& field : {CanField{"sequence", 2}, CanField{kind, 1}, CanField{"run", 1},
                                  CanField{detail, 2}, CanField{"crc", 2}})
      integer(field);
  }
  Message& integers(std::span<const CanField> fields) {
    for (const CanField& field : fields) integer(field);
    return *this;
  }
  void channel(const Channel& channel, const CanScale& scale) {
    const double range = kCanLargestCount * scale.si_per_count;
    text_ += fmt::format(" SG_ {} : {}|24@1- ({:.17g},0) [{:.9g}|{:.9g}] \"{}\" {}\n", channel.name,
                         8 * at_, scale.si_per_count, -range, range, channel.unit, receiver_);
    at_ += kCanCountBytes;
  }
  const std::string& text() const { return text_; }
  std::uint16_t id() const { return id_; }

 private:
  void integer(const CanField& field) {
    text_ += fmt::format(" SG_ {} : {}|{}@1+ (1,0) [0|0] \"\" {}\n", field.name, 8 * at_,
                         8 * field.bytes, receiver_);
    at_ += field.bytes;
  }

  std::uint16_t id_;
  const char* receiver_;
  std::string text_;
  std::size_t at_ = 0;  // of the next signal
};

Message values(const CanValueFrame& frame, std::size_t number, bool setpoint,
               const std::vector<CanScale>& scales, const std::vector<Channel>& channels) {
  Message message(frame.id, fmt::format("{}_{}", setpoint ? "setpoint" : "measurement", number),
                  frame.payload_bytes(), setpoint, setpoint ? "reserved" : "state",
                  setpoint ? "tag" : "time_us");
  for (const std::size_t channel : frame.channels)
    message.channel(channels[channel], scales[channel]);
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
  messages.push_back(Message(kCanCommandId, "command", kCanCommandBytes, true, "code", "reserved")
                         .integers(kCanCommandFields));
  for (std::size_t i = 0; i < layout.setpoints.size(); ++i)
    messages.push_back(values(layout.setpoints[i], i, true, layout.actuator_scale, info.actuators));
  for (std::size_t i = 0; i < layout.sensors.size(); ++i)
    messages.push_back(values(layout.sensors[i], i, false, layout.sensor_scale, info.sensors));
  messages.push_back(Message(kCanStateId, "state", kCanStateBytes, false, "state", "reserved")
                         .integers(kCanStateFields));
  messages.emplace_back(kCanTextId, "text", kCanChunkBytes, false, "reserved", "part");
  messages.emplace_back(kCanUploadId, "upload", kCanChunkBytes, true, "chunk_high", "bytes");
  messages.emplace_back(kCanDownloadId, "download", kCanChunkBytes, false, "chunk_high", "bytes");
  messages.emplace_back(kCanMissingId, "missing", 48, false, "chunk_high", "reserved");

  std::string text = kHead;
  for (const Message& message : messages) text += message.text() + "\n";
  text += kAttributes;
  for (const Message& message : messages)
    text += fmt::format("BA_ \"VFrameFormat\" BO_ {} 14;\n", message.id());
  text += fmt::format("VAL_ {} state{} ;\n", kCanStateId, state_names());
  return text;
}

}  // namespace stageid
