#pragma once

#include <exception>
#include <string>

namespace stageid::test {

/// The message of the Error thrown by `call`; a text that says so if there is another error, or none.
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
