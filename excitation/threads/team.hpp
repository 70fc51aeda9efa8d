#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace stageid {

/// Numbered tiles of a piece of work: neighbours of each other.
struct TileShare {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// Another process of the team has failed: its message and exit code.
class TeamFailed : public std::runtime_error {
 public:
  TeamFailed(const std::string& what, int exit_code)
      : std::runtime_error(what), exit_code_(exit_code) {}
  int exit_code() const noexcept { return exit_code_; }

 private:
  int exit_code_;
};

/// Processes that run the same program on the same request and divide its long work. Each computes the parts of its
/// tiles; parts are added in the order of the tiles, so the bytes of a sum do not depend on the number of processes.
/// Work of a single tile is not divided: every process does it. The ordinary program is a team of one.
///
/// All processes call the same functions in the same order, from one thread at a time.
/// @throws TeamFailed from any function if another process has failed
class Team {
 public:
  virtual ~Team() = default;
  Team(Team&&) = delete;

  static const Team& one();

  int rank() const noexcept { return rank_; }
  int size() const noexcept { return size_; }

  bool divides(Eigen::Index tiles) const noexcept { return size_ > 1 && tiles > 1; }
  /// The tiles of a process.
  TileShare share(Eigen::Index tiles, int rank) const noexcept;
  TileShare share(Eigen::Index tiles) const noexcept { return share(tiles, rank_); }

  /// The sum of the parts of all tiles, `numbers` long each. @param parts those of this process, in order
  Eigen::VectorXd sum(Eigen::Index tiles, Eigen::Index numbers,
                      const std::vector<Eigen::VectorXd>& parts) const;
  /// Sends the rows of each process, `rows_of_tile` per tile, to all others; the last tile may have fewer.
  void gather_rows(Eigen::Index rows_of_tile, Eigen::MatrixXd& matrix) const;
  /// Sends `bytes` of the owner to all others, which may have another size.
  void broadcast(int owner, std::vector<std::byte>& bytes) const;
  /// Whether it is true in any process.
  bool any(bool here) const;

  /// Ends the others with this message and exit code.
  virtual void fail(const std::string& /*what*/, int /*exit_code*/) const {}

  /// What this process has sent.
  struct Traffic {
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
  };
  const Traffic& traffic() const noexcept { return traffic_; }

 protected:
  Team(int rank, int size) : rank_(rank), size_(size) {}

 private:
  virtual void deliver(int to, std::span<const std::byte> bytes) const = 0;
  virtual void receive(int from, std::span<std::byte> bytes) const = 0;
  void send(int to, std::span<const std::byte> bytes) const;
  void broadcast_sized(int owner, std::span<std::byte> bytes) const;

  int rank_;
  int size_;
  mutable Traffic traffic_;
};

/// Who does the work: the threads of this process, and its team. Results do not depend on them.
struct Workers {
  Workers(int of_process, const Team* of_team = nullptr)  // NOLINT(google-explicit-constructor)
      : threads(of_process), team(of_team != nullptr ? of_team : &Team::one()) {}
  int threads;  ///< 0: one per core
  const Team* team;
};

}  // namespace stageid
