#include "tools/measure/live_watch.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <exception>
#include <utility>

#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

constexpr int kLowest = 19;

}  // namespace

LiveWatch::LiveWatch(StageWatch& watch, std::filesystem::path log)
    : thread_([this, &watch, log = std::move(log)] {
        ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kLowest);
        try {
          watch.run(log, true, [this](double) { return !stop_ && !interrupt_flag(); });
          failure_ = watch.doubt();
        } catch (const std::exception& error) {  // errors must not affect the measurement
          failure_ = error.what();
        }
      }) {}

LiveWatch::~LiveWatch() { finish(false); }

std::string LiveWatch::finish(bool log_is_closed) {
  if (!log_is_closed) stop_ = true;
  if (thread_.joinable()) thread_.join();
  return failure_;
}

}  // namespace stageid
