#pragma once

#include <exception>
#include <string>

namespace stageid::test {

/// What the Error says that `call` throws; another kind of error, or none, is said to be so.
template <typename Error, typename Call>
std::string error_message(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  } catch (const std::exception& error) {
    return std::string("another kind of error: ") + error.what();
  }
  return "no error";
}

}  // namespace stageid::test
