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

struct ArrowSystem::GlobalSums {
  explicit GlobalSums(Eigen::Index globals)
      : size(globals), numbers(Eigen::VectorXd::Zero(sums_size(globals))) {}

  Eigen::Map<Eigen::MatrixXd> M() { return {numbers.data(), size, size}; }
  Eigen::Map<Eigen::MatrixXd> schur() { return {numbers.data() + size * size, size, size}; }
  Eigen::Map<Eigen::VectorXd> e() { return {numbers.data() + 2 * size * size, size}; }
  Eigen::Map<Eigen::VectorXd> schur_e() { return {numbers.data() + (2 * size + 1) * size, size}; }
  double& irregular() { return numbers[numbers.size() - 1]; }  ///< channels that are singular

  Eigen::Index size;
  Eigen::VectorXd numbers;
};

ArrowSystem::ArrowSystem(const FitProblem& problem, const FitParameters& beta,
                         const BasisGroups& groups, FitMethod method, ChannelEquationsUse use)
    : ArrowSystem(problem, beta, groups, method, {0, problem.channels()}, use) {}

ArrowSystem::ArrowSystem(const FitProblem& problem, const FitParameters& beta,
                         const BasisGroups& groups, FitMethod method, DataRange part,
                         ChannelEquationsUse use)
    : problem_(problem), beta_(beta), range_(part), use_(use), shared_(problem, beta, method) {
  if (keeps()) channels_.resize(part.count);
  const Eigen::Index first_tile = part.first / kTileChannels;
  const Eigen::Index tiles = channel_tiles(part.first + part.count) - first_tile;
  const Team& team = keeps() ? Team::one() : *problem.team;
  const TileShare own = team.share(tiles);
  const Eigen::Index first = std::max(part.first, (first_tile + own.first) * kTileChannels);
  const Eigen::Index end =
      std::min(part.first + part.count, (first_tile + own.first + own.count) * kTileChannels);
  std::vector<GlobalSums> sums(own.count, GlobalSums(problem.globals()));
  groups.for_each([&](const BasisGroup& group) {
    const std::vector<TileRange> blocks =
        member_blocks(group, {first, end - first}, problem.size());
    if (blocks.empty()) return;
    const GroupProducts products(shared_, group);
    for (const TileRange& block : blocks) {
      const Eigen::Index tile = group.channels[block.first_member] / kTileChannels;
      GlobalSums& out = sums[tile - first_tile - own.first];
      if (out.irregular() == 0.0) add_block(products, block, out);
    }
  });
  std::vector<Eigen::VectorXd> parts;
  for (GlobalSums& of_tile : sums) parts.push_back(std::move(of_tile.numbers));
  GlobalSums all(problem.globals());
  all.numbers = team.sum(tiles, all.numbers.size(), parts);
  regular_ = all.irregular() == 0.0;
  M_ = all.M();
  e_ = all.e();
  schur_ = all.schur() + M_;
  schur_e_ = all.schur_e() + e_;
}

void ArrowSystem::add_block(const GroupProducts& products, const TileRange& block,
                            GlobalSums& out) {
  const auto first_member = products.group.channels.begin() + block.first_member;
  const std::vector<Eigen::Index> members(first_member, first_member + block.members);
  const Eigen::MatrixXd B = beta_.B(members, Eigen::all);
  const LineSums sums = line_sums(products, block, B);
  add_denominators(sums, out);
  std::vector<Channel> channels;
  for (Eigen::Index first = 0; first < block.members && out.irregular() == 0.0; first += kAtOnce) {
    const Eigen::Index count = std::min(kAtOnce, block.members - first);
    channels.resize(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      Channel& channel = channels[i];
      set_channel(sums, B, first + i, channel);
      if (problem_.delays() > 0) add_delays(sums, B, first + i, members[first + i], channel, out);
    }
    add_channels(members.data() + first, channels, out);
  }
}

void ArrowSystem::add_channels(const Eigen::Index* places, std::vector<Channel>& channels,
                               GlobalSums& out) {
  if (use_ != ChannelEquationsUse::only_kept) eliminate(channels, out);
  for (std::size_t i = 0; keeps() && i < channels.size(); ++i)
    channels_[places[i] - range_.first] = std::move(channels[i]);
}

void ArrowSystem::add_denominators(const LineSums& sums, GlobalSums& out) const {
  auto M = out.M();
  auto e = out.e();
  const Eigen::Index n_a = problem_.denominators();
  const auto n_d = std::ssize(shared_.columns);
  for (Eigen::Index d = 0; d < n_d; ++d)
    for (Eigen::Index o = 0; o < n_d; ++o) {
      const Eigen::Index p = shared_.columns[d].parameter;
      const Eigen::Index q = shared_.columns[o].parameter;
      M(p, q) += d >= o ? sums.DD(d, o) : sums.DD(o, d);
    }
  e.head(n_a) += sums.ZE;
  if (shared_.method == FitMethod::gn) return;
  M.topLeftCorner(n_a, n_a) -= sums.ZY;
  if (shared_.method != FitMethod::sk) return;
  M.topLeftCorner(n_a, n_a) += sums.YY - sums.ZY.transpose();
  e.head(n_a) -= sums.YE;
}

void ArrowSystem::set_channel(const LineSums& sums, const Eigen::MatrixXd& B, Eigen::Index member,
                              Channel& channel) const {
  const Eigen::Index n_f = problem_.functions();
  const Eigen::Index n_a = problem_.denominators();
  const auto n_d = std::ssize(shared_.columns);
  channel.bb = from_triangle(sums.FF.col(member), n_f);
  channel.ab.setZero(problem_.globals(), n_f);
  const auto FD = sums.FD.col(member).reshaped(n_d, n_f);
  for (Eigen::Index d = 0; d < n_d; ++d) {
    const auto [function, parameter] = shared_.columns[d];
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
                             Eigen::Index index, Channel& channel, GlobalSums& out) const {
  auto M = out.M();
  const Eigen::Index n_a = problem_.denominators();
  const std::vector<Eigen::Index> delays = delay_parameters(problem_, index);
  for (const Eigen::Index t : delays) {
    channel.ab.row(t) += sums.TF.col(member).transpose();
    channel.ba.col(t) += sums.TF.col(member);
    out.e()[t] += sums.TE[member];
    for (const Eigen::Index o : delays) M(t, o) += sums.TT[member];
    for (std::size_t d = 0; d < shared_.columns.size(); ++d) {
      const auto [f, p] = shared_.columns[d];
      const double value = B(member, f) * sums.TD(static_cast<Eigen::Index>(d), member);
      M(t, p) += value;
      M(p, t) += value;
    }
    if (shared_.method == FitMethod::gn) continue;
    M.row(t).head(n_a) -= sums.TY.col(member).transpose();
    if (shared_.method == FitMethod::sk) M.col(t).head(n_a) -= sums.TY.col(member);
  }
}

void ArrowSystem::eliminate(std::vector<Channel>& channels, GlobalSums& out) const {
  std::vector<char> solved(channels.size());
  const int threads = problem_.functions() < kWorthThreads ? 1 : problem_.threads;
  for_each_task(threads, static_cast<int>(channels.size()), [&](int i) {
    Channel& channel = channels[i];
    Eigen::MatrixXd rhs(channel.ba.rows(), channel.ba.cols() + 1);
    rhs << channel.ba, channel.e;
    Eigen::MatrixXd solution;
    if (!solve_scaled(channel.bb, rhs, solution)) return;
    solved[i] = 1;
    channel.Z = solution.leftCols(channel.ba.cols());
    channel.x = solution.rightCols(1);
  });
  for (std::size_t i = 0; i < channels.size(); ++i) {
    if (solved[i] == 0) {
      out.irregular() += 1.0;
      return;
    }
    const Channel& channel = channels[i];
    out.schur().noalias() -= channel.ab * channel.Z;
    out.schur_e().noalias() -= channel.ab * channel.x;
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
    solve_scaled(channels_[c].bb, e_b.row(c).transpose(), own);
    schur_e.noalias() -= channels_[c].ab * own;
    B.row(c) = own.transpose();
  }
  if (globals == 0) return x;
  x.head(globals) = solve_schur(schur_e, damping, frozen);
  for (std::size_t c = 0; c < channels_.size(); ++c)
    B.row(c) -= (channels_[c].Z * x.head(globals)).transpose();
  return x;
}

}  // namespace stageid
