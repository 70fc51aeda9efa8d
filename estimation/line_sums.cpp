#include "estimation/line_sums.hpp"

#include <complex>

namespace stageid {
namespace {

/// The sums of one share of channels and lines, tile by tile.
class Share {
 public:
  Share(const FitProblem& problem, const BasisGroup& group, const Eigen::MatrixXd& B,
        const std::vector<DerivativeColumn>& columns, const ComplexColumns* Y, FitMethod method,
        const TileRange& range)
      : problem_(problem),
        group_(group),
        B_(B),
        columns_(columns),
        Y_(Y),
        method_(method),
        range_(range),
        n_f_(problem.functions()),
        n_a_(problem.denominators()),
        n_d_(static_cast<Eigen::Index>(columns.size())),
        triangle_(triangular_pairs(n_f_)),
        derivatives_(all_pairs(n_f_, n_d_)),
        errors_(all_pairs(n_f_, n_a_)) {
    BB_.resize(range.members, static_cast<Eigen::Index>(triangle_.size()));
    for (std::size_t p = 0; p < triangle_.size(); ++p)
      BB_.col(static_cast<Eigen::Index>(p)) =
          B_.col(triangle_[p].left).cwiseProduct(B_.col(triangle_[p].right));
    of_function_.resize(static_cast<std::size_t>(n_f_));
    for (Eigen::Index d = 0; d < n_d_; ++d)
      of_function_[static_cast<std::size_t>(columns[static_cast<std::size_t>(d)].function)]
          .push_back(d);
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
      add_numerators();
      add_denominators();
      if (problem_.delays() > 0) add_delays();
    });
    return std::move(sums_);
  }

 private:
  void clear() {
    const Eigen::Index members = range_.members;
    sums_.FF.setZero(static_cast<Eigen::Index>(triangle_.size()), members);
    sums_.FD.setZero(n_f_ * n_d_, members);
    sums_.FE.setZero(n_f_, members);
    sums_.DD.setZero(n_d_, n_d_);
    sums_.ZE.setZero(n_a_);
    if (Y_ != nullptr) sums_.FY.setZero(n_f_ * n_a_, members);
    if (Y_ != nullptr) sums_.ZY.setZero(n_a_, n_a_);
    if (method_ == FitMethod::sk) sums_.YY.setZero(n_a_, n_a_);
    if (method_ == FitMethod::sk) sums_.YE.setZero(n_a_);
    if (problem_.delays() == 0) return;
    sums_.TF.setZero(n_f_, members);
    sums_.TD.setZero(n_d_, members);
    sums_.TT.setZero(members);
    sums_.TE.setZero(members);
    if (Y_ != nullptr) sums_.TY.setZero(n_a_, members);
  }

  auto tile(const Eigen::MatrixXd& columns) const { return columns.middleRows(first_, n_); }

  void add_numerators() {
    const ComplexColumns F{group_.F_re, group_.F_im};
    add_pair_sums(W_, F, F, triangle_, first_, sums_.FF);
    add_pair_sums(W_, F, {group_.D_re, group_.D_im}, derivatives_, first_, sums_.FD);
    if (Y_ != nullptr) add_pair_sums(WE_re_, WE_im_, F, *Y_, errors_, first_, sums_.FY);
    sums_.FE.noalias() += tile(group_.F_re).transpose() * WE_re_.transpose();
    sums_.FE.noalias() += tile(group_.F_im).transpose() * WE_im_.transpose();
  }

  void add_denominators() {
    add_derivative_products();
    // R_f = sum_c B(c,f) W(c,k) E(c,k);  Z_p = sum over the columns d of parameter p of conj(D_d) R.
    const Eigen::MatrixXd R_re = WE_re_.transpose() * B_;
    const Eigen::MatrixXd R_im = WE_im_.transpose() * B_;
    Eigen::MatrixXd Z_re = Eigen::MatrixXd::Zero(n_, n_a_);
    Eigen::MatrixXd Z_im = Eigen::MatrixXd::Zero(n_, n_a_);
    for (Eigen::Index d = 0; d < n_d_; ++d) {
      const auto [f, p] = columns_[static_cast<std::size_t>(d)];
      const auto D_re = group_.D_re.col(d).segment(first_, n_);
      const auto D_im = group_.D_im.col(d).segment(first_, n_);
      Z_re.col(p) += D_re.cwiseProduct(R_re.col(f)) + D_im.cwiseProduct(R_im.col(f));
      Z_im.col(p) += D_re.cwiseProduct(R_im.col(f)) - D_im.cwiseProduct(R_re.col(f));
    }
    sums_.ZE += Z_re.colwise().sum().transpose();
    if (Y_ == nullptr) return;
    sums_.ZY.noalias() += Z_re.transpose() * tile(Y_->re);
    sums_.ZY.noalias() -= Z_im.transpose() * tile(Y_->im);
    if (method_ != FitMethod::sk) return;
    sums_.YY.noalias() += tile(Y_->re).transpose() * (power_.asDiagonal() * tile(Y_->re));
    sums_.YY.noalias() += tile(Y_->im).transpose() * (power_.asDiagonal() * tile(Y_->im));
    sums_.YE.noalias() += tile(Y_->re).transpose() * power_;
  }

  /// The channels are summed before the derivatives are multiplied: one matrix product for all pairs
  /// of functions.
  void add_derivative_products() {
    const Eigen::MatrixXd weight = W_.transpose() * BB_;
    Eigen::VectorXd re(n_);
    Eigen::VectorXd im(n_);
    for (std::size_t p = 0; p < triangle_.size(); ++p) {
      const auto [f, g] = triangle_[p];
      for (const Eigen::Index l : of_function_[static_cast<std::size_t>(f)]) {
        const auto w = weight.col(static_cast<Eigen::Index>(p));
        re = w.cwiseProduct(group_.D_re.col(l).segment(first_, n_));
        im = w.cwiseProduct(group_.D_im.col(l).segment(first_, n_));
        for (const Eigen::Index r : of_function_[static_cast<std::size_t>(g)])
          if (l >= r)
            sums_.DD(l, r) += re.dot(group_.D_re.col(r).segment(first_, n_)) +
                              im.dot(group_.D_im.col(r).segment(first_, n_));
      }
    }
  }

  void add_delays() {
    const Eigen::MatrixXd T_re = B_ * tile(group_.T_re).transpose();
    const Eigen::MatrixXd T_im = B_ * tile(group_.T_im).transpose();
    const Eigen::MatrixXd WT_re = W_.cwiseProduct(T_re);
    const Eigen::MatrixXd WT_im = W_.cwiseProduct(T_im);
    sums_.TF.noalias() += tile(group_.F_re).transpose() * WT_re.transpose();
    sums_.TF.noalias() += tile(group_.F_im).transpose() * WT_im.transpose();
    sums_.TD.noalias() += tile(group_.D_re).transpose() * WT_re.transpose();
    sums_.TD.noalias() += tile(group_.D_im).transpose() * WT_im.transpose();
    sums_.TT += (WT_re.cwiseProduct(T_re) + WT_im.cwiseProduct(T_im)).rowwise().sum();
    const Eigen::MatrixXd TE = T_re.cwiseProduct(WE_re_) + T_im.cwiseProduct(WE_im_);
    sums_.TE += TE.rowwise().sum();
    if (Y_ == nullptr) return;
    sums_.TY.noalias() += tile(Y_->re).transpose() * TE.transpose();
    sums_.TY.noalias() -= tile(Y_->im).transpose() *
                          (T_re.cwiseProduct(WE_im_) - T_im.cwiseProduct(WE_re_)).transpose();
  }

  const FitProblem& problem_;
  const BasisGroup& group_;
  const Eigen::MatrixXd& B_;
  const std::vector<DerivativeColumn>& columns_;
  const ComplexColumns* Y_;
  FitMethod method_;
  TileRange range_;
  Eigen::Index n_f_, n_a_, n_d_;
  std::vector<ColumnPair> triangle_, derivatives_, errors_;
  std::vector<std::vector<Eigen::Index>> of_function_;
  Eigen::MatrixXd BB_;  // members x triangle
  Eigen::Index first_ = 0, n_ = 0;
  DataTile data_;
  Eigen::MatrixXd& W_ = data_.W;
  Eigen::MatrixXd& WE_re_ = data_.E_re;  // weighted in place
  Eigen::MatrixXd& WE_im_ = data_.E_im;
  Eigen::VectorXd power_;
  LineSums sums_;
};

}  // namespace

LineSums& LineSums::operator+=(const LineSums& other) {
  FF += other.FF;
  FD += other.FD;
  FY += other.FY;
  FE += other.FE;
  DD += other.DD;
  ZY += other.ZY;
  ZE += other.ZE;
  YY += other.YY;
  YE += other.YE;
  TF += other.TF;
  TD += other.TD;
  TY += other.TY;
  TT += other.TT;
  TE += other.TE;
  return *this;
}

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

LineSums line_sums(const FitProblem& problem, const BasisGroup& group, const TileRange& block,
                   const Eigen::MatrixXd& B, const std::vector<DerivativeColumn>& columns,
                   const ComplexColumns* Y, FitMethod method) {
  return sum_over_shares<LineSums>(block, problem.threads, [&](const TileRange& share) {
    return Share(problem, group, B, columns, Y, method, share).run();
  });
}

}  // namespace stageid
