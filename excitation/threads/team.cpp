#include "excitation/threads/team.hpp"

#include <algorithm>

namespace stageid {
namespace {

class TeamOfOne : public Team {
 public:
  TeamOfOne() : Team(0, 1) {}

 private:
  void deliver(int, std::span<const std::byte>) const override {}
  void receive(int, std::span<std::byte>) const override {}
};

std::span<std::byte> bytes_of(Eigen::Ref<Eigen::VectorXd> numbers) {
  return std::as_writable_bytes(
      std::span(numbers.data(), static_cast<std::size_t>(numbers.size())));
}

}  // namespace

const Team& Team::one() {
  static const TeamOfOne team;
  return team;
}

TileShare Team::share(Eigen::Index tiles, int rank) const noexcept {
  if (!divides(tiles)) return {0, tiles};
  const Eigen::Index first = tiles * rank / size_;
  return {first, tiles * (rank + 1) / size_ - first};
}

void Team::send(int to, std::span<const std::byte> bytes) const {
  ++traffic_.messages;
  traffic_.bytes += bytes.size();
  deliver(to, bytes);
}

// A chain instead of a tree: the order of the tiles is that of a loop, at the price of one latency per process.
Eigen::VectorXd Team::sum(Eigen::Index tiles, Eigen::Index numbers,
                          const std::vector<Eigen::VectorXd>& parts) const {
  Eigen::VectorXd total = Eigen::VectorXd::Zero(numbers);
  const bool divided = divides(tiles);
  if (divided && rank_ > 0) receive(rank_ - 1, bytes_of(total));
  for (const Eigen::VectorXd& part : parts) total += part;
  if (divided && rank_ + 1 < size_) send(rank_ + 1, bytes_of(total));
  if (divided) broadcast_sized(size_ - 1, bytes_of(total));
  return total;
}

void Team::gather_rows(Eigen::Index rows_of_tile, Eigen::MatrixXd& matrix) const {
  const Eigen::Index tiles = (matrix.rows() + rows_of_tile - 1) / rows_of_tile;
  if (!divides(tiles)) return;
  for (int owner = 0; owner < size_; ++owner) {
    const TileShare own = share(tiles, owner);
    const Eigen::Index first = own.first * rows_of_tile;
    const Eigen::Index count = std::min(own.count * rows_of_tile, matrix.rows() - first);
    if (own.count == 0) continue;
    Eigen::MatrixXd rows = matrix.middleRows(first, count);
    broadcast_sized(owner, bytes_of(rows.reshaped()));
    matrix.middleRows(first, count) = rows;
  }
}

void Team::broadcast(int owner, std::vector<std::byte>& bytes) const {
  if (size_ == 1) return;
  std::uint64_t size = bytes.size();
  broadcast_sized(owner, std::as_writable_bytes(std::span(&size, 1)));
  bytes.resize(size);
  broadcast_sized(owner, bytes);
}

bool Team::any(bool here) const {
  return sum(size_, 1, {Eigen::VectorXd::Constant(1, here ? 1.0 : 0.0)})[0] > 0.0;
}

// A binomial tree: in round i, the 2^i processes that have the bytes send them to as many others.
void Team::broadcast_sized(int owner, std::span<std::byte> bytes) const {
  const int place = (rank_ - owner + size_) % size_;
  const auto at = [&](int other) { return (other + owner) % size_; };
  int step = 1;
  while (step <= place) step *= 2;
  if (place > 0) receive(at(place - step / 2), bytes);
  for (; place + step < size_; step *= 2) send(at(place + step), bytes);
}

}  // namespace stageid
