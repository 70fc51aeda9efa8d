#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

namespace stageid {

/// @throws Error with the formatted text unless `holds`. The order in which the arguments are computed is not defined: a
/// call that sets errno comes before.
template <typename Error = std::invalid_argument, typename... Args>
void require(bool holds, fmt::format_string<Args...> text, Args&&... args) {
  if (!holds) throw Error(fmt::format(text, std::forward<Args>(args)...));
}

}  // namespace stageid
