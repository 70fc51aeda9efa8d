#include "estimation/arrow_system.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <complex>

#include "estimation/weighted_products.hpp"

namespace stageid {
namespace {

/// (j omega)^q / A_i on every line, a column for every denominator coefficient.
void equation_error_columns(const FitProblem& problem, const FitParameters& beta,
                            Eigen::MatrixXd& re, Eigen::MatrixXd& im) {
  re.resize(problem.size(), problem.denominators());
  im.resize(problem.size(), problem.denominators());
  Eigen::Index column = 0;
  for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
    const Eigen::VectorXd& a = beta.a[i];
    for (Eigen::Index k = 0; k < problem.size(); ++k) {
      const std::complex<double> s(0.0, problem.lines.omega_rad_s[k]);
      std::complex<double> A = 0.0;
      for (Eigen::Index q = a.size(); q > 0; --q) A = (A + a[q - 1]) * s;
      A += 1.0;
      std::complex<double> power = 1.0 / A;
      for (Eigen::Index q = 0; q < a.size(); ++q) {
        power *= s;
        re(k, column + q) = power.real();
        im(k, column + q) = power.imag();
      }
    }
    column += a.size();
  }
}

/// sum_k Re{ conj(D_l) D_r } sum_c B(c, f_l) W(c, k) B(c, f_r) for l >= r: the channels are summed
/// before the derivatives are multiplied, as one matrix product for all pairs of functions.
Eigen::MatrixXd derivative_products(const Eigen::MatrixXd& W, const Eigen::MatrixXd& B,
                                    const std::vector<DerivativeColumn>& columns,
                                    const BasisGroup& group, int threads) {
  const auto n_d = static_cast<Eigen::Index>(columns.size());
  std::vector<std::vector<Eigen::Index>> of_function(static_cast<std::size_t>(B.cols()));
  for (Eigen::Index d = 0; d < n_d; ++d)
    of_function[static_cast<std::size_t>(columns[static_cast<std::size_t>(d)].function)].push_back(
        d);
  const std::vector<ColumnPair> pairs = triangular_pairs(B.cols());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n_d, n_d);
  for_each_pair_block(
      static_cast<Eigen::Index>(pairs.size()), W.cols(), threads,
      [&](Eigen::Index first, Eigen::Index count, Eigen::Index k, Eigen::Index n) {
        Eigen::MatrixXd BB(B.rows(), count);
        for (Eigen::Index p = 0; p < count; ++p) {
          const auto [f, g] = pairs[static_cast<std::size_t>(first + p)];
          BB.col(p) = B.col(f).cwiseProduct(B.col(g));
        }
        const Eigen::MatrixXd weight = W.middleCols(k, n).transpose() * BB;
        for (Eigen::Index p = 0; p < count; ++p) {
          const auto [f, g] = pairs[static_cast<std::size_t>(first + p)];
          for (const Eigen::Index l : of_function[static_cast<std::size_t>(f)])
            for (const Eigen::Index r : of_function[static_cast<std::size_t>(g)])
              if (l >= r)
                out(l, r) += (weight.col(p).array() * (group.D_re.col(l).segment(k, n).array() *
                                                           group.D_re.col(r).segment(k, n).array() +
                                                       group.D_im.col(l).segment(k, n).array() *
                                                           group.D_im.col(r).segment(k, n).array()))
                                 .sum();
        }
      });
  return out;
}

}  // namespace

bool solve_scaled(const Eigen::MatrixXd& M, const Eigen::MatrixXd& b, Eigen::MatrixXd& x) {
  const Eigen::VectorXd scale = M.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * M * scale.asDiagonal();
  scaled.diagonal().array() += 1e-14;
  const Eigen::LLT<Eigen::MatrixXd> factor(scaled);
  if (factor.info() != Eigen::Success) return false;
  x = scale.asDiagonal() * factor.solve(scale.asDiagonal() * b);
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
                         const std::vector<BasisGroup>& groups, const Residual& E, FitMethod method)
    : problem_(problem),
      beta_(beta),
      E_(E),
      method_(method),
      columns_(derivative_columns(problem)) {
  const Eigen::Index globals = problem.globals();
  M_.setZero(globals, globals);
  e_.setZero(globals);
  channels_.resize(static_cast<std::size_t>(problem.channels()));
  if (method != FitMethod::gn) equation_error_columns(problem, beta, Y_re_, Y_im_);
  for (const BasisGroup& group : groups) add_group(group);
  eliminate();
}

void ArrowSystem::add_group(const BasisGroup& group) {
  const auto members = static_cast<Eigen::Index>(group.channels.size());
  const Eigen::Index n_f = problem_.functions();
  const Eigen::Index n_a = problem_.denominators();
  const auto n_d = static_cast<Eigen::Index>(columns_.size());
  const Eigen::MatrixXd W = rows_of(problem_.W, group.channels);
  const Eigen::MatrixXd WE_re = W.cwiseProduct(rows_of(E_.re, group.channels));
  const Eigen::MatrixXd WE_im = W.cwiseProduct(rows_of(E_.im, group.channels));
  const Eigen::MatrixXd B = rows_of(beta_.B, group.channels);
  const ComplexColumns F{group.F_re, group.F_im};
  const ComplexColumns D{group.D_re, group.D_im};

  const auto triangle = triangular_pairs(n_f);
  const Eigen::MatrixXd FF = weighted_pair_sums(W, F, F, triangle, problem_.threads);
  const Eigen::MatrixXd FD = weighted_pair_sums(W, F, D, all_pairs(n_f, n_d), problem_.threads);
  Eigen::MatrixXd FY;
  if (method_ != FitMethod::gn)
    FY = weighted_pair_sums(ComplexColumns{WE_re, WE_im}, F, ComplexColumns{Y_re_, Y_im_},
                            all_pairs(n_f, n_a), problem_.threads);
  Eigen::MatrixXd e_b = WE_re * group.F_re;
  e_b.noalias() += WE_im * group.F_im;

  for (Eigen::Index r = 0; r < members; ++r) {
    Channel& channel =
        channels_[static_cast<std::size_t>(group.channels[static_cast<std::size_t>(r)])];
    channel.bb.resize(n_f, n_f);
    for (std::size_t p = 0; p < triangle.size(); ++p)
      channel.bb(triangle[p].left, triangle[p].right) =
          channel.bb(triangle[p].right, triangle[p].left) = FF(r, static_cast<Eigen::Index>(p));
    channel.ba.setZero(n_f, problem_.globals());
    for (Eigen::Index j = 0; j < n_f; ++j)
      for (Eigen::Index d = 0; d < n_d; ++d) {
        const auto [function, parameter] = columns_[static_cast<std::size_t>(d)];
        channel.ba(j, parameter) += B(r, function) * FD(r, j * n_d + d);
      }
    channel.ab = channel.ba.transpose();
    if (method_ != FitMethod::gn)
      for (Eigen::Index j = 0; j < n_f; ++j)
        for (Eigen::Index p = 0; p < n_a; ++p) channel.ba(j, p) -= FY(r, j * n_a + p);
    if (method_ == FitMethod::sk) channel.ab = channel.ba.transpose();
    channel.e = e_b.row(r).transpose();
  }
  add_denominator_block(group, B, W, WE_re, WE_im);
  if (problem_.delays() > 0) add_delay_columns(group, B, W, WE_re, WE_im);
}

void ArrowSystem::add_denominator_block(const BasisGroup& group, const Eigen::MatrixXd& B,
                                        const Eigen::MatrixXd& W, const Eigen::MatrixXd& WE_re,
                                        const Eigen::MatrixXd& WE_im) {
  const Eigen::Index n_a = problem_.denominators();
  const auto n_d = static_cast<Eigen::Index>(columns_.size());
  const Eigen::MatrixXd block = derivative_products(W, B, columns_, group, problem_.threads);
  // sum_c B(c,f) W(c,k) E(c,k)
  const Eigen::MatrixXd r_re = WE_re.transpose() * B;
  const Eigen::MatrixXd r_im = WE_im.transpose() * B;
  Eigen::MatrixXd Z_re = Eigen::MatrixXd::Zero(problem_.size(), n_a);
  Eigen::MatrixXd Z_im = Eigen::MatrixXd::Zero(problem_.size(), n_a);
  for (Eigen::Index d = 0; d < n_d; ++d) {
    const auto [f, p] = columns_[static_cast<std::size_t>(d)];
    Z_re.col(p) +=
        group.D_re.col(d).cwiseProduct(r_re.col(f)) + group.D_im.col(d).cwiseProduct(r_im.col(f));
    Z_im.col(p) +=
        group.D_re.col(d).cwiseProduct(r_im.col(f)) - group.D_im.col(d).cwiseProduct(r_re.col(f));
    for (Eigen::Index o = 0; o < n_d; ++o) {
      const Eigen::Index q = columns_[static_cast<std::size_t>(o)].parameter;
      M_(p, q) += d >= o ? block(d, o) : block(o, d);
    }
  }
  e_.head(n_a) += Z_re.colwise().sum().transpose();
  if (method_ == FitMethod::gn) return;
  const Eigen::MatrixXd ZY = Z_re.transpose() * Y_re_ - Z_im.transpose() * Y_im_;
  M_.topLeftCorner(n_a, n_a) -= ZY;
  if (method_ != FitMethod::sk) return;
  const Eigen::VectorXd power = (WE_re.cwiseProduct(rows_of(E_.re, group.channels)) +
                                 WE_im.cwiseProduct(rows_of(E_.im, group.channels)))
                                    .colwise()
                                    .sum()
                                    .transpose();
  M_.topLeftCorner(n_a, n_a) -= ZY.transpose();
  M_.topLeftCorner(n_a, n_a) += Y_re_.transpose() * power.asDiagonal() * Y_re_ +
                                Y_im_.transpose() * power.asDiagonal() * Y_im_;
  e_.head(n_a) -= Y_re_.transpose() * power;
}

void ArrowSystem::add_delay_columns(const BasisGroup& group, const Eigen::MatrixXd& B,
                                    const Eigen::MatrixXd& W, const Eigen::MatrixXd& WE_re,
                                    const Eigen::MatrixXd& WE_im) {
  const Eigen::MatrixXd T_re = B * group.T_re.transpose();
  const Eigen::MatrixXd T_im = B * group.T_im.transpose();
  const Eigen::MatrixXd WT_re = W.cwiseProduct(T_re);
  const Eigen::MatrixXd WT_im = W.cwiseProduct(T_im);
  const Eigen::MatrixXd TF = WT_re * group.F_re + WT_im * group.F_im;
  const Eigen::MatrixXd TD = WT_re * group.D_re + WT_im * group.D_im;
  const Eigen::VectorXd TT = (WT_re.cwiseProduct(T_re) + WT_im.cwiseProduct(T_im)).rowwise().sum();
  const Eigen::VectorXd TE = (T_re.cwiseProduct(WE_re) + T_im.cwiseProduct(WE_im)).rowwise().sum();
  Eigen::MatrixXd TY;
  if (method_ != FitMethod::gn)
    TY = (T_re.cwiseProduct(WE_re) + T_im.cwiseProduct(WE_im)) * Y_re_ -
         (T_re.cwiseProduct(WE_im) - T_im.cwiseProduct(WE_re)) * Y_im_;

  for (std::size_t r = 0; r < group.channels.size(); ++r) {
    const auto row = static_cast<Eigen::Index>(r);
    const std::vector<Eigen::Index> delays = delay_parameters(problem_, group.channels[r]);
    Channel& channel = channels_[static_cast<std::size_t>(group.channels[r])];
    for (const Eigen::Index t : delays) {
      channel.ab.row(t) += TF.row(row);
      channel.ba.col(t) += TF.row(row).transpose();
      e_[t] += TE[row];
      for (const Eigen::Index o : delays) M_(t, o) += TT[row];
      for (std::size_t d = 0; d < columns_.size(); ++d) {
        const auto [f, p] = columns_[d];
        const double value = B(row, f) * TD(row, static_cast<Eigen::Index>(d));
        M_(t, p) += value;
        M_(p, t) += value;
      }
      if (method_ == FitMethod::gn) continue;
      M_.row(t).head(problem_.denominators()) -= TY.row(row);
      if (method_ == FitMethod::sk)
        M_.col(t).head(problem_.denominators()) -= TY.row(row).transpose();
    }
  }
}

void ArrowSystem::eliminate() {
  schur_ = M_;
  schur_e_ = e_;
  for (Channel& channel : channels_) {
    Eigen::MatrixXd rhs(channel.ba.rows(), channel.ba.cols() + 1);
    rhs << channel.ba, channel.e;
    Eigen::MatrixXd solution;
    if (!solve_scaled(channel.bb, rhs, solution)) {
      regular_ = false;
      return;
    }
    channel.Z = solution.leftCols(channel.ba.cols());
    channel.x = solution.rightCols(1);
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
  // RIV's matrix is not symmetric: LU, scaled by the diagonal of its symmetric twin.
  const Eigen::VectorXd scale =
      M_.diagonal().cwiseAbs().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd scaled = scale.asDiagonal() * schur_ * scale.asDiagonal();
  scaled.diagonal() += damping * scaled.diagonal().cwiseAbs().cwiseMax(1e-12);
  Eigen::VectorXd rhs = scale.cwiseProduct(right_side);
  hold_unknowns(frozen, scaled);
  for (const Eigen::Index i : frozen) rhs[i] = 0.0;
  return scale.cwiseProduct(scaled.partialPivLu().solve(rhs));
}

ArrowSystem::Step ArrowSystem::solve(double damping) const {
  Step step;
  if (!regular_) return step;
  step.globals = problem_.globals() > 0 ? solve_globals(damping) : Eigen::VectorXd();
  step.B.resize(problem_.channels(), problem_.functions());
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    const Channel& channel = channels_[c];
    step.B.row(static_cast<Eigen::Index>(c)) = (channel.x - channel.Z * step.globals).transpose();
  }
  step.ok = step.globals.allFinite() && step.B.allFinite();
  return step;
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
