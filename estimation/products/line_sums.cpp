#include "estimation/products/line_sums.hpp"

namespace stageid {
namespace {

/// The sums of one share of channels and lines, tile by tile.
class Share {
 public:
  Share(const GroupProducts& products, const Eigen::MatrixXd& B, const TileRange& range)
      : products_(products),
        group_(products.group),
        columns_(products.method.columns),
        problem_(products.method.problem),
        method_(products.method.method),
        Y_(products.method.Y),
        B_(B),
        range_(range),
        n_f_(problem_.functions()),
        n_a_(problem_.denominators()),
        n_d_(std::ssize(columns_)) {
    BB_.resize(range.members, std::ssize(products.functions));
    Eigen::Index p = 0;
    for (const auto& [functions, pairs] : products.functions)
      BB_.col(p++) = B_.col(functions.first).cwiseProduct(B_.col(functions.second));
    clear();
  }

  LineSums run() {
    for_each_tile(range_, [&](Eigen::Index first, Eigen::Index n) {
      first_ = first;
      n_ = n;
      data_.load(problem_, group_, range_, B_, first, n);
      if (method_ == FitMethod::sk)
        power_ =
            W_.cwiseProduct(WE_re_.cwiseAbs2() + WE_im_.cwiseAbs2()).colwise().sum().transpose();
      WE_re_.array() *= W_.array();
      WE_im_.array() *= W_.array();
      add_fractions();
      add_numerators();
      add_denominators();
      if (problem_.delays() > 0) add_delays();
    });
    return std::move(sums_);
  }

 private:
  void clear() {
    const Eigen::Index members = range_.members;
    const auto direct = [&](const PairReduction& pairs, Eigen::MatrixXd& sums) {
      sums.setZero(std::ssize(pairs.direct()), members);
    };
    direct(products_.FF, sums_.FF);
    direct(products_.FD, sums_.FD);
    sums_.S.setZero(members, group_.fractions.base->cols());
    sums_.FE.setZero(n_f_, members);
    sums_.DD.setZero(n_d_, n_d_);
    sums_.ZE.setZero(n_a_);
    if (regresses()) {
      direct(products_.FY, sums_.FY);
      sums_.S_re.setZero(members, simple_columns());
      sums_.S_im = sums_.S_re;
      sums_.ZY.setZero(n_a_, n_a_);
    }
    if (method_ == FitMethod::sk) sums_.YY.setZero(n_a_, n_a_);
    if (method_ == FitMethod::sk) sums_.YE.setZero(n_a_);
    if (problem_.delays() == 0) return;
    sums_.TF.setZero(n_f_, members);
    sums_.TD.setZero(n_d_, members);
    sums_.TT.setZero(members);
    sums_.TE.setZero(members);
    if (regresses()) sums_.TY.setZero(n_a_, members);
  }

  bool regresses() const { return method_ != FitMethod::gn; }
  auto tile(const Eigen::MatrixXd& columns) const { return columns.middleRows(first_, n_); }

  Eigen::Index simple_columns() const {
    return group_.fractions.pairs() > 0 ? group_.fractions.simple_columns() : 0;
  }

  void add_fractions() {
    const FractionColumns& fractions = group_.fractions;
    if (fractions.pairs() == 0) return;
    add_fraction_sums(W_, fractions, first_, sums_.S);
    if (!regresses()) return;
    const Eigen::VectorXd re = tile(fractions.first.re);
    const Eigen::VectorXd im = tile(fractions.first.im);
    const auto base = fractions.base->block(first_, 0, n_, simple_columns());
    const Eigen::MatrixXd V_re = WE_re_ * re.asDiagonal() + WE_im_ * im.asDiagonal();
    const Eigen::MatrixXd V_im = WE_im_ * re.asDiagonal() - WE_re_ * im.asDiagonal();
    sums_.S_re.noalias() += V_re * base;
    sums_.S_im.noalias() += V_im * base;
  }

  void add_numerators() {
    const SplitMatrix& F = group_.F;
    add_pair_sums(W_, F, F, products_.FF.direct(), first_, sums_.FF);
    add_pair_sums(W_, F, group_.D, products_.FD.direct(), first_, sums_.FD);
    if (regresses()) add_pair_sums(WE_re_, WE_im_, F, Y_, products_.FY.direct(), first_, sums_.FY);
    sums_.FE.noalias() += tile(group_.F.re).transpose() * WE_re_.transpose();
    sums_.FE.noalias() += tile(group_.F.im).transpose() * WE_im_.transpose();
  }

  void add_denominators() {
    add_derivative_products();
    // R_f = sum_c B(c,f) W(c,k) E(c,k);  Z_p = sum over the columns d of parameter p of conj(D_d) R.
    const Eigen::MatrixXd R_re = WE_re_.transpose() * B_;
    const Eigen::MatrixXd R_im = WE_im_.transpose() * B_;
    Eigen::MatrixXd Z_re = Eigen::MatrixXd::Zero(n_, n_a_);
    Eigen::MatrixXd Z_im = Eigen::MatrixXd::Zero(n_, n_a_);
    for (Eigen::Index d = 0; d < n_d_; ++d) {
      const auto [f, p] = columns_[d];
      const auto D_re = group_.D.re.col(d).segment(first_, n_);
      const auto D_im = group_.D.im.col(d).segment(first_, n_);
      Z_re.col(p) += D_re.cwiseProduct(R_re.col(f)) + D_im.cwiseProduct(R_im.col(f));
      Z_im.col(p) += D_re.cwiseProduct(R_im.col(f)) - D_im.cwiseProduct(R_re.col(f));
    }
    sums_.ZE += Z_re.colwise().sum().transpose();
    if (!regresses()) return;
    sums_.ZY.noalias() += Z_re.transpose() * tile(Y_.re);
    sums_.ZY.noalias() -= Z_im.transpose() * tile(Y_.im);
    if (method_ != FitMethod::sk) return;
    sums_.YY.noalias() += tile(Y_.re).transpose() * (power_.asDiagonal() * tile(Y_.re));
    sums_.YY.noalias() += tile(Y_.im).transpose() * (power_.asDiagonal() * tile(Y_.im));
    sums_.YE.noalias() += tile(Y_.re).transpose() * power_;
  }

  /// The channels are summed before the derivatives are multiplied, which gives one matrix product for all pairs of
  /// functions.
  void add_derivative_products() {
    const Eigen::MatrixXd weight = W_.transpose() * BB_;
    Eigen::VectorXd re(n_);
    Eigen::VectorXd im(n_);
    Eigen::Index p = 0;
    for (const auto& [functions, pairs] : products_.functions) {
      const auto w = weight.col(p++);
      Eigen::Index weighted = -1;
      for (const auto& [l, r] : pairs) {
        if (weighted != l) {
          re = w.cwiseProduct(group_.D.re.col(l).segment(first_, n_));
          im = w.cwiseProduct(group_.D.im.col(l).segment(first_, n_));
          weighted = l;
        }
        sums_.DD(l, r) += re.dot(group_.D.re.col(r).segment(first_, n_)) +
                          im.dot(group_.D.im.col(r).segment(first_, n_));
      }
    }
  }

  void add_delays() {
    const Eigen::MatrixXd T_re = B_ * tile(group_.T.re).transpose();
    const Eigen::MatrixXd T_im = B_ * tile(group_.T.im).transpose();
    const Eigen::MatrixXd WT_re = W_.cwiseProduct(T_re);
    const Eigen::MatrixXd WT_im = W_.cwiseProduct(T_im);
    sums_.TF.noalias() += tile(group_.F.re).transpose() * WT_re.transpose();
    sums_.TF.noalias() += tile(group_.F.im).transpose() * WT_im.transpose();
    sums_.TD.noalias() += tile(group_.D.re).transpose() * WT_re.transpose();
    sums_.TD.noalias() += tile(group_.D.im).transpose() * WT_im.transpose();
    sums_.TT += (WT_re.cwiseProduct(T_re) + WT_im.cwiseProduct(T_im)).rowwise().sum();
    const Eigen::MatrixXd TE = T_re.cwiseProduct(WE_re_) + T_im.cwiseProduct(WE_im_);
    sums_.TE += TE.rowwise().sum();
    if (!regresses()) return;
    sums_.TY.noalias() += tile(Y_.re).transpose() * TE.transpose();
    sums_.TY.noalias() -= tile(Y_.im).transpose() *
                          (T_re.cwiseProduct(WE_im_) - T_im.cwiseProduct(WE_re_)).transpose();
  }

  const GroupProducts& products_;
  const BasisGroup& group_;
  const std::vector<DerivativeColumn>& columns_;
  const FitProblem& problem_;
  FitMethod method_;
  const SplitMatrix& Y_;
  const Eigen::MatrixXd& B_;
  TileRange range_;
  Eigen::Index n_f_, n_a_, n_d_;
  Eigen::MatrixXd BB_;  // members x pairs of functions with direct products of derivatives
  Eigen::Index first_ = 0, n_ = 0;
  DataTile data_;
  Eigen::MatrixXd& W_ = data_.W;
  Eigen::MatrixXd& WE_re_ = data_.E_re;  // weighted in place
  Eigen::MatrixXd& WE_im_ = data_.E_im;
  Eigen::VectorXd power_;
  LineSums sums_;
};

/// Adds the products that were reduced to fractions to their sums.
void expand(const GroupProducts& products, const Eigen::MatrixXd& B, int threads, LineSums& sums) {
  sums.FF = products.FF.expand(sums.S, sums.FF, threads);
  sums.FD = products.FD.expand(sums.S, sums.FD, threads);
  if (sums.FY.cols() > 0) sums.FY = products.FY.expand(sums.S_re, sums.S_im, sums.FY, threads);
  products.DD.for_each_pair(threads, [&](std::size_t p) {
    if (!products.DD.is_reduced(p)) return;
    const auto [l, r] = products.DD.pairs()[p];
    const auto left = B.col(products.method.columns[l].function);
    const auto right = B.col(products.method.columns[r].function);
    sums.DD(l, r) += products.DD.weighted_sum(p, sums.S, left.cwiseProduct(right));
  });
}

}  // namespace

LineSums& LineSums::operator+=(const LineSums& other) {
  using Sums = LineSums;
  for (Eigen::MatrixXd Sums::*sum :
       {&Sums::FF, &Sums::FD, &Sums::FY, &Sums::FE, &Sums::DD, &Sums::ZY, &Sums::YY, &Sums::TF,
        &Sums::TD, &Sums::TY, &Sums::S, &Sums::S_re, &Sums::S_im})
    this->*sum += other.*sum;
  for (Eigen::VectorXd Sums::*sum : {&Sums::ZE, &Sums::YE, &Sums::TT, &Sums::TE})
    this->*sum += other.*sum;
  return *this;
}

GroupProducts::GroupProducts(const EquationMethod& of_method, const BasisGroup& of_group)
    : method(of_method),
      group(of_group),
      FF(group.fractions, group.fractions.F, group.fractions.F,
         triangular_pairs(method.problem.functions())),
      FD(group.fractions, group.fractions.F, group.fractions.D,
         all_pairs(method.problem.functions(), std::ssize(method.columns))),
      FY(group.fractions, group.fractions.F, group.fractions.Y,
         all_pairs(method.problem.functions(), method.Y.cols())),
      DD(group.fractions, group.fractions.D, group.fractions.D,
         triangular_pairs(std::ssize(method.columns))) {
  for (const auto& [l, r] : DD.direct()) {
    const Eigen::Index f = method.columns[l].function;
    const Eigen::Index g = method.columns[r].function;
    functions[{f, g}].push_back({l, r});
  }
}

LineSums line_sums(const GroupProducts& products, const TileRange& block,
                   const Eigen::MatrixXd& B) {
  const int threads = products.method.problem.threads;
  LineSums sums = ordered_sum(line_shares(block), threads, [&](const TileRange& share) {
    return Share(products, B, share).run();
  });
  expand(products, B, threads, sums);
  return sums;
}

}  // namespace stageid
