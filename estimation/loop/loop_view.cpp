#include "estimation/loop/loop_view.hpp"

#include <algorithm>

#include "estimation/loop/response_gradient.hpp"
#include "estimation/uncertainty/dense_covariance.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kLinesAtOnce = 32;

/// Fills the radii of some lines: all gradients of these lines are multiplied by the covariance at once.
void fill_radii(const ResponseGradient& gradient, const std::vector<LoopPoint>& points,
                const Eigen::MatrixXd& covariance, Eigen::Index first, Eigen::Index count,
                LoopView& view) {
  const Eigen::Index curves = view.loop.rows() + 1;
  Eigen::MatrixXd parts(gradient.parameters(), 2 * curves * count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::MatrixXcd g = gradient.of(first + k, points[first + k].weights);
    parts.middleCols(2 * curves * k, curves) = g.real();
    parts.middleCols(2 * curves * k + curves, curves) = g.imag();
  }
  const Eigen::MatrixXd products = covariance * parts;
  for (Eigen::Index k = 0; k < count; ++k)
    for (Eigen::Index i = 0; i < curves; ++i) {
      const Eigen::Index re = 2 * curves * k + i;
      const Eigen::Index im = re + curves;
      (i + 1 < curves ? view.loop_radius(i, first + k) : view.determinant_radius[first + k]) =
          disc_radius_95(parts.col(re).dot(products.col(re)), parts.col(im).dot(products.col(im)),
                         parts.col(re).dot(products.col(im)));
    }
}

}  // namespace

LoopView loop_view(const AdditiveModel& model, const LoopController& controller,
                   const Eigen::MatrixXd& covariance, const Eigen::VectorXd& frequency_hz) {
  LoopView out;
  const std::vector<LoopPoint> points =
      loop_points(model, controller, frequency_hz, covariance.size() > 0);
  const Eigen::Index N = frequency_hz.size();
  out.frequency_hz = frequency_hz;
  out.loop.resize(controller.actuators.cols(), N);
  out.determinant.resize(N);
  for (Eigen::Index k = 0; k < N; ++k) {
    out.loop.col(k) = points[k].loop;
    out.determinant[k] = points[k].determinant;
  }
  out.poles = loop_poles(model, controller);
  if (out.poles.stable()) out.margins = loop_margins(model, controller, covariance);
  if (covariance.size() == 0) return out;
  const ResponseGradient gradient(model, covariance.rows(), frequency_hz);
  out.loop_radius.resizeLike(out.loop);
  out.determinant_radius.resize(N);
  for (Eigen::Index first = 0; first < N; first += kLinesAtOnce)
    fill_radii(gradient, points, covariance, first, std::min(kLinesAtOnce, N - first), out);
  return out;
}

}  // namespace stageid
