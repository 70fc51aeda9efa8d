#include "acquisition/files/version.hpp"

namespace stageid {

std::string_view version() noexcept { return STAGEID_VERSION; }

}  // namespace stageid
