#include "estimation/model/basis.hpp"

#include <cmath>

#include "acquisition/files/fail.hpp"
#include "estimation/model/partial_fractions.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// Adds factor x to a column of out.
void add(Complex factor, const SplitMatrix& x, SplitMatrix& out, Eigen::Index column) {
  out.re.col(column) += factor.real() * x.re.col(0) - factor.imag() * x.im.col(0);
  out.im.col(column) += factor.real() * x.im.col(0) + factor.imag() * x.re.col(0);
}

}  // namespace

SubmodelShape shape_of(const Submodel& submodel) {
  return {submodel.integrators, submodel.order(), static_cast<int>(submodel.numerator.size()) - 1};
}

std::vector<std::complex<double>> roots(const Eigen::Ref<const Eigen::VectorXd>& a) {
  const Eigen::Index n = a.size();
  if (n == 0) return {};
  if (n == 1) return {Complex(-1.0 / a[0])};
  if (n == 2) {
    const Complex half = std::sqrt(Complex(a[0] * a[0] - 4.0 * a[1]));
    // The larger root first and the other from the product, to avoid cancellation.
    const Complex first = (a[0] >= 0.0 ? -a[0] - half : -a[0] + half) / (2.0 * a[1]);
    return {first, 1.0 / (a[1] * first)};
  }
  // Companion matrix of x^n + a_1 x^{n-1} + ... + a_n, x = 1/s: well scaled for poles of any size.
  const double scale = std::pow(std::abs(a[n - 1]), 1.0 / static_cast<double>(n));
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(n, n);
  double power = 1.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    power *= scale;
    companion(0, i) = -a[i] / power;
    if (i + 1 < n) companion(i + 1, i) = 1.0;
  }
  const Eigen::VectorXcd inverse = eigenvalues(companion);
  std::vector<Complex> out;
  for (const Complex x : inverse) out.push_back(1.0 / (x * scale));
  return out;
}

void evaluate_basis(const HoldEquivalent& through, const SubmodelShape& shape,
                    const Eigen::Ref<const Eigen::VectorXd>& a, WantedBasis wanted,
                    SubmodelBasis& out) {
  const Eigen::Index N = through.lines();
  const int n = shape.order;
  const int l = shape.integrators;
  if (shape.numerator_degree > n + l) fail_request("model: a submodel is improper");
  if (l > 2) fail_request("model: at most two integrators in a submodel");

  std::vector<Complex> poles(1);  // [0]: the origin
  for (const Complex lambda : roots(a)) poles.push_back(lambda);
  std::vector<Fractions> fractions(poles.size());
  for (std::size_t r = l > 0 ? 0 : 1; r < poles.size(); ++r)
    through.fractions(poles[r], {r == 0 || wanted.gradient, wanted.delay}, fractions[r]);
  const double highest = n > 0 ? a[n - 1] : 1.0;

  out.value.set_zero(N, shape.functions());
  out.delay.set_zero(wanted.delay ? N : 0, wanted.delay ? shape.functions() : 0);
  const Eigen::Index slopes = wanted.gradient ? Eigen::Index{shape.functions()} * n : 0;
  out.gradient.set_zero(slopes > 0 ? N : 0, slopes);

  for (int m = 0; m <= shape.numerator_degree; ++m) {
    const int cancelled = std::min(m, l);
    const PartialFractions value{poles, l - cancelled, 1, m - cancelled, highest};
    value.for_each([&](std::size_t r, Complex simple, Complex squared) {
      const Fractions& f = fractions[r];
      add(simple, f.simple, out.value, m);
      if (squared != 0.0) add(squared, f.squared, out.value, m);
      if (!wanted.delay) return;
      add(simple, f.simple_delay, out.delay, m);
      if (squared != 0.0) add(squared, f.squared_delay, out.delay, m);
    });
    if (m == n + l) {  // biproper
      add(1.0 / highest, through.constant(), out.value, m);
      if (wanted.delay) add(1.0 / highest, through.constant_delay(), out.delay, m);
    }
    if (!wanted.gradient) continue;
    for (int q = 1; q <= n; ++q) {  // d/da_q = -s^(m+q) / (s^l A^2)
      const int gone = std::min(m + q, l);
      const PartialFractions slope{poles, l - gone, 2, m + q - gone, highest * highest};
      const Eigen::Index column = m * n + q - 1;
      slope.for_each([&](std::size_t r, Complex simple, Complex squared) {
        add(-simple, fractions[r].simple, out.gradient, column);
        if (squared != 0.0) add(-squared, fractions[r].squared, out.gradient, column);
      });
      if (m + q == 2 * n + l)
        add(-1.0 / (highest * highest), through.constant(), out.gradient, column);
    }
  }
}

std::map<double, std::vector<Eigen::Index>> channels_by_delay(const Eigen::VectorXd& input_s,
                                                              const Eigen::VectorXd& output_s,
                                                              Eigen::Index outputs,
                                                              Eigen::Index first,
                                                              Eigen::Index count) {
  std::map<double, std::vector<Eigen::Index>> groups;
  for (Eigen::Index c = first; c < first + count; ++c)
    groups[(input_s.size() > 0 ? input_s[c / outputs] : 0.0) +
           (output_s.size() > 0 ? output_s[c % outputs] : 0.0)]
        .push_back(c);
  return groups;
}

}  // namespace stageid
