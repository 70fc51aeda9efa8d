#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "estimation/products/line_sums.hpp"

namespace stageid {

/// Treatment of the equations of the channels.
enum class ChannelEquationsUse : std::uint8_t {
  eliminated,  ///< and discarded: memory of one block of channels; for solve_globals()
  kept,        ///< eliminated and stored
  only_kept    ///< stored without elimination, M may be singular; no Z, x, Schur complement
};

/// The equations of one step, M d_beta = e, in the order beta = (globals, numerators of channel 1,
/// 2, ...). Globals are the denominator coefficients of all submodels, then the delays.
///
/// With J the Jacobian dP/dbeta (the instrument Phih of the paper) and Phi the regressor,
///   riv: M = sum Re{J^H W Phi},  e = sum Re{J^H W vec E}   (identity of docs/theory.md, section 8)
///   gn:  M = sum Re{J^H W J},    e the same
///   sk:  M = sum Re{Phi^H W Phi}, e = sum Re{Phi^H W vec E}
/// Phi differs from J only in the denominator columns: those of J minus (j omega)^q E / A_i.
///
/// With diagonal W, the numerators of different channels are not coupled, so M is an arrow: channels are
/// eliminated one by one and the Schur complement on the globals is solved. Each process of a team eliminates its own
/// channels if they are not kept; only the sums for the globals, sums_size() numbers, are sent.
class ArrowSystem {
 public:
  /// @pre `groups` were evaluated with derivatives at `beta`.
  ArrowSystem(const FitProblem& problem, const FitParameters& beta, const BasisGroups& groups,
              FitMethod method, ChannelEquationsUse use = ChannelEquationsUse::kept);

  /// The contribution of these channels only: M, e and the Schur complement are sums over parts.
  ArrowSystem(const FitProblem& problem, const FitParameters& beta, const BasisGroups& groups,
              FitMethod method, DataRange part,
              ChannelEquationsUse use = ChannelEquationsUse::kept);

  /// The step of the globals with `damping` times the diagonal of the Schur complement added to it; that of the
  /// numerators of a channel is then x - Z times it. `frozen` globals remain unchanged.
  Eigen::VectorXd solve_globals(double damping, const std::vector<Eigen::Index>& frozen = {}) const;

  /// M^-1 times a right-hand side other than e, both (globals, vec B); the same damping. @pre regular()
  Eigen::VectorXd solve(const Eigen::VectorXd& right_side, double damping,
                        const std::vector<Eigen::Index>& frozen) const;

  /// The part of one channel in M: border and numerator block.
  struct Channel {
    Eigen::MatrixXd ab;  ///< globals x n_f
    Eigen::MatrixXd ba;  ///< n_f x globals
    Eigen::MatrixXd bb;  ///< n_f x n_f
    Eigen::VectorXd e;   ///< n_f
    Eigen::MatrixXd Z;   ///< bb^-1 ba, n_f x globals; if eliminated
    Eigen::VectorXd x;   ///< bb^-1 e
  };
  /// @pre the channel is stored
  const Channel& channel(Eigen::Index c) const { return channels_[c - range_.first]; }
  const Eigen::MatrixXd& M_globals() const noexcept { return M_; }
  const Eigen::VectorXd& e_globals() const noexcept { return e_; }
  const Eigen::MatrixXd& schur() const noexcept { return schur_; }
  const Eigen::VectorXd& schur_gradient() const noexcept { return schur_e_; }
  /// Whether all channels could be eliminated; if not, those after the first failure are missing.
  bool regular() const noexcept { return regular_; }

  /// Numbers that a process sends to sum the equations of `globals` unknowns over all channels.
  static Eigen::Index sums_size(Eigen::Index globals) { return 2 * globals * (globals + 1) + 1; }

 private:
  /// M and e of the globals and their Schur complement, summed over the channels of a tile.
  struct GlobalSums;

  bool keeps() const noexcept { return use_ != ChannelEquationsUse::eliminated; }
  void add_block(const GroupProducts& products, const TileRange& block, GlobalSums& out);
  void add_denominators(const LineSums& sums, GlobalSums& out) const;
  void set_channel(const LineSums& sums, const Eigen::MatrixXd& B, Eigen::Index member,
                   Channel& channel) const;
  void add_delays(const LineSums& sums, const Eigen::MatrixXd& B, Eigen::Index member,
                  Eigen::Index index, Channel& channel, GlobalSums& out) const;
  /// Eliminates the channels in the given order, and stores them if they are kept.
  void add_channels(const Eigen::Index* places, std::vector<Channel>& channels, GlobalSums& out);
  void eliminate(std::vector<Channel>& channels, GlobalSums& out) const;
  Eigen::VectorXd solve_schur(const Eigen::VectorXd& right_side, double damping,
                              const std::vector<Eigen::Index>& frozen) const;

  const FitProblem& problem_;
  const FitParameters& beta_;
  DataRange range_;
  ChannelEquationsUse use_;
  EquationMethod shared_;
  Eigen::MatrixXd M_;
  Eigen::VectorXd e_;
  std::vector<Channel> channels_;
  Eigen::MatrixXd schur_;
  Eigen::VectorXd schur_e_;
  bool regular_ = true;
};

/// Replaces rows and columns of frozen unknowns by those of the unit matrix.
void hold_unknowns(const std::vector<Eigen::Index>& frozen, Eigen::MatrixXd& M);

/// Solves M x = b for symmetric positive M, scaled to unit diagonal; b may have several columns.
class ScaledNormalEquations {
 public:
  explicit ScaledNormalEquations(const Eigen::MatrixXd& M);
  bool ok() const { return factor_.info() == Eigen::Success; }
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;

 private:
  Eigen::VectorXd scale_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};
/// The same at once. @returns false if M is singular to rounding.
bool solve_scaled(const Eigen::MatrixXd& M, const Eigen::MatrixXd& b, Eigen::MatrixXd& x);

}  // namespace stageid
