#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

#include "excitation/threads/team.hpp"

namespace stageid {

/// Values as bytes, for other processes of the same program. The same calls of operator() pack and unpack. Of other
/// types, carry(parcel, value) calls it for every member.
class Parcel {
 public:
  Parcel() = default;  ///< packs
  explicit Parcel(std::vector<std::byte> bytes) : bytes_(std::move(bytes)), opened_(true) {}

  template <typename T>
  void operator()(T& value) {
    if constexpr (std::is_trivially_copyable_v<T>) {
      raw(&value, sizeof value);
    } else if constexpr (requires { value.rows(); }) {
      auto rows = value.rows();
      auto cols = value.cols();
      (*this)(rows);
      (*this)(cols);
      value.resize(rows, cols);
      raw(value.data(), static_cast<std::size_t>(value.size()) * sizeof(*value.data()));
    } else if constexpr (requires { value.resize(0); }) {
      std::size_t size = value.size();
      (*this)(size);
      value.resize(size);
      for (auto& entry : value) (*this)(entry);
    } else {
      carry(*this, value);
    }
  }

  std::vector<std::byte> bytes() && { return std::move(bytes_); }

 private:
  void raw(void* value, std::size_t size) {
    if (size == 0) return;
    if (opened_) {
      std::memcpy(value, bytes_.data() + at_, size);
      at_ += size;
    } else {
      const auto* first = static_cast<const std::byte*>(value);
      bytes_.insert(bytes_.end(), first, first + size);
    }
  }

  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
  bool opened_ = false;
};

/// Gives the value of the owner to all processes of a team.
template <typename T>
void broadcast(const Team& team, int owner, T& value) {
  if (team.size() == 1) return;
  std::vector<std::byte> bytes;
  if (team.rank() == owner) {
    Parcel packed;
    packed(value);
    bytes = std::move(packed).bytes();
  }
  team.broadcast(owner, bytes);
  if (team.rank() != owner) Parcel(std::move(bytes))(value);
}

}  // namespace stageid
