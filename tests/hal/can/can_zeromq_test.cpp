#include "hal/can/can_zeromq.hpp"

#include <gtest/gtest.h>
#include <zmq.h>

#include <array>
#include <vector>

#include "hal/can/can_encoding.hpp"
#include "hal/stage/stage.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_can_zeromq {

/// The node's socket.
class Router {
 public:
  explicit Router(const std::string& endpoint) {
    EXPECT_EQ(zmq_bind(socket_.get(), endpoint.c_str()), 0);
  }

  std::vector<std::uint8_t> receive() {
    host_.resize(64);
    host_.resize(zmq_recv(socket_.get(), host_.data(), host_.size(), 0));
    std::vector<std::uint8_t> message(1000);
    message.resize(zmq_recv(socket_.get(), message.data(), message.size(), 0));
    return message;
  }
  void answer(const std::vector<std::uint8_t>& message) {
    zmq_send(socket_.get(), host_.data(), host_.size(), ZMQ_SNDMORE);
    zmq_send(socket_.get(), message.data(), message.size(), 0);
  }

 private:
  ZeroMqSocket socket_{ZMQ_ROUTER};
  std::vector<std::uint8_t> host_;
};

void send(ZeroMqCan& can, const CanFrame& frame) {
  for (int i = 0; i < 500 && can.send({&frame, 1}) == 0; ++i) can.wait(can.now_ns() + 10'000'000);
}

std::vector<CanFrame> receive(ZeroMqCan& can, std::size_t wanted) {
  std::vector<CanFrame> frames;
  std::array<CanFrame, kCanInboxFrames> inbox;
  for (int i = 0; i < 500 && frames.size() < wanted; ++i) {
    can.wait(can.now_ns() + 10'000'000);
    frames.insert(frames.end(), inbox.begin(),
                  inbox.begin() + static_cast<long>(can.receive(inbox)));
  }
  return frames;
}

TEST(ZeroMqCan, TakesEndpointsOnly) {
  EXPECT_TRUE(is_zeromq("tcp://10.0.0.7:5555"));
  EXPECT_TRUE(is_zeromq("ipc:///run/stage"));
  EXPECT_FALSE(is_zeromq("can0"));
  EXPECT_THROW(ZeroMqCan("tcp://nowhere"), StageError);
}

TEST(ZeroMqCan, AFrameIsAMessageOf72Bytes) {
  const test::TemporaryDirectory directory;
  const std::string endpoint = "ipc://" + (directory / "node").string();
  Router node(endpoint);
  ZeroMqCan can(endpoint);
  const CanFrame sent = encode_can_command({.code = CanCommandCode::hello, .sequence = 3});
  send(can, sent);
  std::vector<std::uint8_t> message = node.receive();
  ASSERT_EQ(message.size(), 72U);
  EXPECT_EQ(message[0], 0x80);
  EXPECT_EQ(message[2], 48);
  EXPECT_TRUE(std::equal(sent.data.begin(), sent.data.end(), message.begin() + 8));

  std::vector<std::uint8_t> too_long = message;
  too_long.push_back(0);
  std::vector<std::uint8_t> length_65 = message;
  length_65[2] = 65;
  for (const auto& bad : {std::vector<std::uint8_t>{}, too_long, length_65}) node.answer(bad);
  node.answer(message);
  const std::vector<CanFrame> received = receive(can, 1);
  ASSERT_EQ(received.size(), 1U);
  EXPECT_EQ(received[0].id, sent.id);
  EXPECT_EQ(received[0].length, sent.length);
  EXPECT_EQ(received[0].data, sent.data);
  EXPECT_GT(received[0].t_rx_ns, 0);
  EXPECT_EQ(can.health(0).error_frames, 3U);
}

TEST(ZeroMqCan, NothingIsKeptForANodeThatIsNotThere) {
  const test::TemporaryDirectory directory;
  ZeroMqCan can("ipc://" + (directory / "node").string());
  const CanFrame frame = encode_can_command({.code = CanCommandCode::hello, .sequence = 3});
  EXPECT_EQ(can.send({&frame, 1}), 0U);
  EXPECT_EQ(can.health(0).send_refused, 1U);
}

}  // namespace stageid::test_can_zeromq
