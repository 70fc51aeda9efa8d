#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

struct XXH3_state_s;

namespace stageid {

/// XXH3-128 of a stream of bytes: identifies inputs in outputs. Not a protection against forgery.
class Fingerprint {
 public:
  Fingerprint();
  void add(std::span<const std::byte> bytes);
  void add(std::string_view text);
  std::string hex() const;  ///< 32 hexadecimal digits

 private:
  struct Free {
    void operator()(XXH3_state_s* state) const noexcept;
  };
  std::unique_ptr<XXH3_state_s, Free> state_;
};

std::string fingerprint_of(std::string_view text);
/// @throws FileError
std::string fingerprint_of_file(const std::filesystem::path& file);

}  // namespace stageid
