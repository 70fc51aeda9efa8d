#include "estimation/equations/arrow_system.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kAtOnce = 16;        // channels eliminated together
constexpr Eigen::Index kWorthThreads = 64;  // functions

}  // namespace

ScaledNormalEquations::ScaledNormalEquations(const Eigen::MatrixXd& M)
    : scale_(M.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse()) {
  Eigen::MatrixXd scaled = scale_.asDiagonal() * M * scale_.asDiagonal();
  // Far below the rounding of the sums; needed only to factorize coinciding poles.
  scaled.diagonal().array() += 1e-14;
  factor_.compute(scaled);
}

Eigen::MatrixXd ScaledNormalEquations::solve(const Eigen::MatrixXd& b) const {
  return scale_.asDiagonal() * factor_.solve(scale_.asDiagonal() * b);
}

bool solve_scaled(const Eigen::MatrixXd& M, const Eigen::MatrixXd& b, Eigen::MatrixXd& x) {
  const ScaledNormalEquations equations(M);
  if (!equations.ok()) return false;
  x = equations.solve(b);
  return x.allFinite();
}

void hold_unknowns(const std::vector<Eigen::Index>& frozen, Eigen::MatrixXd& M) {
  for (const Eigen::Index i : frozen) {
    M.row(i).setZero();
    M.col(i).setZero();
    M(i, i) = 1.0;
  }
}

ArrowSystem::ArrowSystem(const FitProblem& problem, const FitParameters& beta,
                         const std::vector<BasisGroup>& groups, FitMethod method,
                         ChannelEquationsUse use)
    : ArrowSystem(problem, beta, groups, method, {0, problem.channels()}, use) {}

ArrowSystem::ArrowSystem(const FitProblem& problem, const FitParameters& beta,
                         const std::vector<BasisGroup>& groups, FitMethod method, IndexRange part,
                         ChannelEquationsUse use)
    : problem_(problem), beta_(beta), range_(part), use_(use), shared_(problem, beta, method) {
  const Eigen::Index globals = problem.globals();
  M_.setZero(globals, globals);
  e_.setZero(globals);
  schur_.setZero(globals, globals);
  schur_e_.setZero(globals);
  if (keeps()) channels_.resize(static_cast<std::size_t>(part.count));
  for (const BasisGroup& group : groups) {
    const Eigen::Index* all = group.channels.data();
    const Eigen::Index* all_end = all + group.channels.size();
    // the channels are sorted
    const Eigen::Index* begin = std::lower_bound(all, all_end, part.first);
    const Eigen::Index* end = std::lower_bound(begin, all_end, part.first + part.count);
    if (begin == end) continue;
    const GroupProducts products(shared_, group);
    for (const TileRange& block : member_blocks(begin - all, end - begin, problem.size()))
      if (regular_) add_block(products, block);
  }
  schur_ += M_;
  schur_e_ += e_;
}

void ArrowSystem::add_block(const GroupProducts& products, const TileRange& block) {
  const auto first_member = products.group.channels.begin() + block.first_member;
  const std::vector<Eigen::Index> members(first_member, first_member + block.members);
  const Eigen::MatrixXd B = beta_.B(members, Eigen::all);
  const LineSums sums = line_sums(products, block, B);
  add_denominators(sums);
  std::vector<Channel> channels;
  for (Eigen::Index first = 0; first < block.members && regular_; first += kAtOnce) {
    const Eigen::Index count = std::min(kAtOnce, block.members - first);
    channels.resize(static_cast<std::size_t>(count));
    for (Eigen::Index i = 0; i < count; ++i) {
      Channel& channel = channels[static_cast<std::size_t>(i)];
      set_channel(sums, B, first + i, channel);
      if (problem_.delays() > 0)
        add_delays(sums, B, first + i, members[static_cast<std::size_t>(first + i)], channel);
    }
    add_channels(members.data() + first, channels);
  }
}

void ArrowSystem::add_channels(const Eigen::Index* places, std::vector<Channel>& channels) {
  if (use_ != ChannelEquationsUse::only_kept) eliminate(channels);
  for (std::size_t i = 0; keeps() && i < channels.size(); ++i)
    channels_[static_cast<std::size_t>(places[i] - range_.first)] = std::move(channels[i]);
}

void ArrowSystem::add_denominators(const LineSums& sums) {
  const Eigen::Index n_a = problem_.denominators();
  const auto n_d = static_cast<Eigen::Index>(shared_.columns.size());
  for (Eigen::Index d = 0; d < n_d; ++d)
    for (Eigen::Index o = 0; o < n_d; ++o) {
      const Eigen::Index p = shared_.columns[static_cast<std::size_t>(d)].parameter;
      const Eigen::Index q = shared_.columns[static_cast<std::size_t>(o)].parameter;
      M_(p, q) += d >= o ? sums.DD(d, o) : sums.DD(o, d);
    }
  e_.head(n_a) += sums.ZE;
  if (shared_.method == FitMethod::gn) return;
  M_.topLeftCorner(n_a, n_a) -= sums.ZY;
  if (shared_.method != FitMethod::sk) return;
  M_.topLeftCorner(n_a, n_a) += sums.YY - sums.ZY.transpose();
  e_.head(n_a) -= sums.YE;
}

void ArrowSystem::set_channel(const LineSums& sums, const Eigen::MatrixXd& B, Eigen::Index member,
                              Channel& channel) const {
  const Eigen::Index n_f = problem_.functions();
  const Eigen::Index n_a = problem_.denominators();
  const auto n_d = static_cast<Eigen::Index>(shared_.columns.size());
  channel.bb = from_triangle(sums.FF.col(member), n_f);
  channel.ab.setZero(problem_.globals(), n_f);
  const auto FD = sums.FD.col(member).reshaped(n_d, n_f);
  for (Eigen::Index d = 0; d < n_d; ++d) {
    const auto [function, parameter] = shared_.columns[static_cast<std::size_t>(d)];
    channel.ab.row(parameter) += B(member, function) * FD.row(d);
  }
  if (shared_.method == FitMethod::sk)
    channel.ab.topRows(n_a) -= sums.FY.col(member).reshaped(n_a, n_f);
  channel.ba = channel.ab.transpose();
  if (shared_.method == FitMethod::riv)
    channel.ba.leftCols(n_a) -= sums.FY.col(member).reshaped(n_a, n_f).transpose();
  channel.e = sums.FE.col(member);
}

void ArrowSystem::add_delays(const LineSums& sums, const Eigen::MatrixXd& B, Eigen::Index member,
                             Eigen::Index index, Channel& channel) {
  const Eigen::Index n_a = problem_.denominators();
  const std::vector<Eigen::Index> delays = delay_parameters(problem_, index);
  for (const Eigen::Index t : delays) {
    channel.ab.row(t) += sums.TF.col(member).transpose();
    channel.ba.col(t) += sums.TF.col(member);
    e_[t] += sums.TE[member];
    for (const Eigen::Index o : delays) M_(t, o) += sums.TT[member];
    for (std::size_t d = 0; d < shared_.columns.size(); ++d) {
      const auto [f, p] = shared_.columns[d];
      const double value = B(member, f) * sums.TD(static_cast<Eigen::Index>(d), member);
      M_(t, p) += value;
      M_(p, t) += value;
    }
    if (shared_.method == FitMethod::gn) continue;
    M_.row(t).head(n_a) -= sums.TY.col(member).transpose();
    if (shared_.method == FitMethod::sk) M_.col(t).head(n_a) -= sums.TY.col(member);
  }
}

void ArrowSystem::eliminate(std::vector<Channel>& channels) {
  std::vector<char> solved(channels.size());
  const int threads = problem_.functions() < kWorthThreads ? 1 : problem_.threads;
  for_each_task(threads, static_cast<int>(channels.size()), [&](int i) {
    Channel& channel = channels[static_cast<std::size_t>(i)];
    Eigen::MatrixXd rhs(channel.ba.rows(), channel.ba.cols() + 1);
    rhs << channel.ba, channel.e;
    Eigen::MatrixXd solution;
    if (!solve_scaled(channel.bb, rhs, solution)) return;
    solved[static_cast<std::size_t>(i)] = 1;
    channel.Z = solution.leftCols(channel.ba.cols());
    channel.x = solution.rightCols(1);
  });
  for (std::size_t i = 0; i < channels.size(); ++i) {
    regular_ = regular_ && solved[i] != 0;
    if (!regular_) return;
    const Channel& channel = channels[i];
    schur_.noalias() -= channel.ab * channel.Z;
    schur_e_.noalias() -= channel.ab * channel.x;
  }
}

Eigen::VectorXd ArrowSystem::solve_globals(double damping,
                                           const std::vector<Eigen::Index>& frozen) const {
  return solve_schur(schur_e_, damping, frozen);
}

Eigen::VectorXd ArrowSystem::solve_schur(const Eigen::VectorXd& right_side, double damping,
                                         const std::vector<Eigen::Index>& frozen) const {
  // The matrix of RIV is not symmetric: LU, scaled by the diagonal of its symmetric counterpart.
  const Eigen::VectorXd scale =
      M_.diagonal().cwiseAbs().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * schur_ * scale.asDiagonal();
  scaled.diagonal() += damping * scaled.diagonal().cwiseAbs().cwiseMax(1e-12);
  Eigen::VectorXd rhs = scale.cwiseProduct(right_side);
  hold_unknowns(frozen, scaled);
  for (const Eigen::Index i : frozen) rhs[i] = 0.0;
  return scale.cwiseProduct(scaled.partialPivLu().solve(rhs));
}

Eigen::VectorXd ArrowSystem::solve(const Eigen::VectorXd& right_side, double damping,
                                   const std::vector<Eigen::Index>& frozen) const {
  const Eigen::Index globals = problem_.globals();
  Eigen::VectorXd x(right_side.size());
  auto B = x.tail(right_side.size() - globals).reshaped(problem_.channels(), problem_.functions());
  const auto e_b = right_side.tail(right_side.size() - globals)
                       .reshaped(problem_.channels(), problem_.functions());
  Eigen::VectorXd schur_e = right_side.head(globals);
  Eigen::MatrixXd own;
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    const auto row = static_cast<Eigen::Index>(c);
    solve_scaled(channels_[c].bb, e_b.row(row).transpose(), own);
    schur_e.noalias() -= channels_[c].ab * own;
    B.row(row) = own.transpose();
  }
  if (globals == 0) return x;
  x.head(globals) = solve_schur(schur_e, damping, frozen);
  for (std::size_t c = 0; c < channels_.size(); ++c)
    B.row(static_cast<Eigen::Index>(c)) -= (channels_[c].Z * x.head(globals)).transpose();
  return x;
}

}  // namespace stageid
