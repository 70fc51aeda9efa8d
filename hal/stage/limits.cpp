#include "hal/stage/limits.hpp"

namespace stageid {

const char* to_string(LimitKind kind) noexcept {
  return word_at(kWords<LimitKind>, static_cast<std::size_t>(kind), "unknown limit");
}

}  // namespace stageid
