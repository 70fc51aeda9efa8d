#include "hal/plugin/plugin_stage.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <array>

#include "hal/plugin/stageid_backend.h"

namespace stageid {
namespace {

constexpr std::size_t kTextSize = 512;
using Text = std::array<char, kTextSize>;

/// The library's text, even without a terminating zero.
std::string text_of(Text& text) {
  text.back() = '\0';
  return text.data();
}

Outcome outcome_of(int code) noexcept {
  using enum Outcome;
  constexpr std::array kOutcomes = {ok, late, incomplete, stale, corrupt, link_down};
  return code >= STAGEID_OK && code <= STAGEID_LINK_DOWN ? kOutcomes[static_cast<std::size_t>(code)]
                                                         : fault;
}

std::vector<stageid_channel> channels_of(const std::vector<Channel>& channels) {
  std::vector<stageid_channel> out;
  for (const Channel& channel : channels)
    out.push_back({channel.name.c_str(), channel.unit.c_str()});
  return out;
}

}  // namespace

/// The loaded library and the stage that it opened.
struct PluginStage::Library {
  explicit Library(const std::filesystem::path& file) : name(file.string()) {
    // dlopen() would search a name without a slash in the system folders.
    const std::string path = std::filesystem::absolute(file).string();
    handle.reset(::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL));
    if (!handle) {
      std::string reason = ::dlerror();  // begins with the path
      if (reason.starts_with(path + ": ")) reason.erase(0, path.size() + 2);
      fail(fmt::format("cannot be loaded: {}; {}", reason,
                       std::filesystem::exists(file)
                           ? "build it as a shared library for this machine"
                           : "check its path in the stage file"));
    }
    using Entry = const struct stageid_backend* (*)();
    const auto entry = reinterpret_cast<Entry>(::dlsym(handle.get(), "stageid_get_backend"));
    if (entry == nullptr)
      fail("has no function stageid_get_backend(); add it as described in stageid_backend.h");
    calls = entry();
    if (calls == nullptr || calls->version != STAGEID_BACKEND_VERSION)
      fail(
          fmt::format("has interface version {}, this program has {}; rebuild it with this "
                      "program's stageid_backend.h",
                      calls == nullptr ? 0 : calls->version, STAGEID_BACKEND_VERSION));
    if (calls->size < sizeof(struct stageid_backend) || calls->open == nullptr ||
        calls->describe == nullptr || calls->start == nullptr || calls->exchange == nullptr ||
        calls->stop == nullptr || calls->trouble == nullptr || calls->close == nullptr)
      fail("is incomplete; set every function of struct stageid_backend, and set size to its size");
  }
  Library(Library&&) = delete;
  ~Library() {
    if (stage == nullptr) return;
    calls->stop(stage);
    calls->close(stage);
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw StageError(fmt::format("plugin: {}: {}", name, what));
  }

  void open(const StageInfo& info, const PluginSpec& spec, double pace) {
    const std::vector<stageid_channel> actuators = channels_of(info.actuators);
    const std::vector<stageid_channel> sensors = channels_of(info.sensors);
    std::vector<stageid_key> keys;
    for (const auto& [key, value] : spec.keys) keys.push_back({key.c_str(), value.c_str()});
    const stageid_request request = {STAGEID_BACKEND_VERSION,
                                     info.sample_rate_hz,
                                     pace,
                                     static_cast<std::uint32_t>(actuators.size()),
                                     static_cast<std::uint32_t>(sensors.size()),
                                     static_cast<std::uint32_t>(keys.size()),
                                     actuators.data(),
                                     sensors.data(),
                                     keys.data()};
    Text error{};
    stage = calls->open(&request, error.data(), error.size());
    if (stage == nullptr) fail(text_of(error));
  }

  std::string name;
  std::unique_ptr<void, int (*)(void*)> handle{nullptr, ::dlclose};
  const struct stageid_backend* calls = nullptr;
  void* stage = nullptr;
};

PluginStage::PluginStage(StageInfo info, const PluginSpec& spec, double pace)
    : info_(std::move(info)), library_(std::make_unique<Library>(spec.library)) {
  library_->open(info_, spec, pace);
  stageid_description description{};
  library_->calls->describe(library_->stage, &description);
  if (description.maximum_rate_hz > 0.0 && description.maximum_rate_hz < info_.sample_rate_hz)
    library_->fail(
        fmt::format("supports at most {} Hz, but the stage file has {} Hz; lower sample_rate_hz",
                    description.maximum_rate_hz, info_.sample_rate_hz));
  info_.backend = "plugin";
  if (description.maximum_rate_hz > 0.0) info_.maximum_rate_hz = description.maximum_rate_hz;
  if (description.transport_delay_s > 0.0) info_.delay_s = description.transport_delay_s;
  info_.clock = description.virtual_time != 0 ? Clock::virtual_time : Clock::wall;
  info_.pace = info_.clock == Clock::wall && pace > 0.0 ? pace : 1.0;
  info_.stamps = info_.clock == Clock::wall;
}

PluginStage::~PluginStage() = default;

void PluginStage::start(std::uint64_t run_seed, Inputs& first) {
  stageid_sample sample{first.y.data(), 0, 0, 0};
  Text error{};
  if (library_->calls->start(library_->stage, run_seed, &sample, error.data(), error.size()) != 0) {
    stop();
    library_->fail(text_of(error));
  }
  first.cycle = 0;
  first.valid = sample.valid;
  first.t_sample_ns = sample.t_sample_ns;
  first.t_rx_ns = sample.t_receive_ns;
  first.node_state = NodeState::operation_enabled;
}

Outcome PluginStage::exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept {
  stageid_sample sample{inputs.y.data(), 0, inputs.t_sample_ns, inputs.t_rx_ns};
  const int code = library_->calls->exchange(library_->stage, outputs.cycle, outputs.u.data(),
                                             deadline.t_ns, &sample);
  inputs.cycle = outputs.cycle + 1;
  inputs.valid = sample.valid;
  inputs.t_sample_ns = sample.t_sample_ns;
  inputs.t_rx_ns = sample.t_receive_ns;
  inputs.t_arrival_ns = inputs.stamp_ns = sample.t_receive_ns;
  return outcome_of(code);
}

void PluginStage::stop() noexcept { library_->calls->stop(library_->stage); }

std::string PluginStage::trouble() const {
  Text text{};
  library_->calls->trouble(library_->stage, text.data(), text.size());
  return text_of(text);
}

}  // namespace stageid
