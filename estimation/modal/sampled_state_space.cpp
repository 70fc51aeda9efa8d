#include "estimation/modal/sampled_state_space.hpp"

#include <cmath>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/singular_shapes.hpp"
#include "estimation/model/hold_integral.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// The delays in samples, channel (i, j): whole_output_i + whole_input_j + rest_ij, with
/// rest_ij = part_output_i + part_input_j in (-1, 1).
struct DividedDelays {
  Eigen::VectorXd whole_output;
  Eigen::VectorXd whole_input;
  Eigen::VectorXd part_output;
  Eigen::VectorXd part_input;
  Eigen::MatrixXd rest;
  Eigen::Index late_channels() const { return (rest.array() > 0.0).count(); }
};

double in_samples(double delay_s, double period_s) {
  const SplitDelay split = split_delay(delay_s, period_s);
  return split.whole + split.fraction;
}

/// Output `first` has no fraction; those of the others are in [0, 1), those of the inputs in (-1, 0].
DividedDelays divide_from(Eigen::Index first, const Eigen::VectorXd& input_s,
                          const Eigen::VectorXd& output_s, double period_s) {
  DividedDelays out;
  out.whole_output.resize(output_s.size());
  out.part_output.resize(output_s.size());
  for (Eigen::Index i = 0; i < output_s.size(); ++i) {
    const SplitDelay split = split_delay(output_s[i] - output_s[first], period_s);
    out.whole_output[i] = split.whole;
    out.part_output[i] = split.fraction;
  }
  out.whole_input.resize(input_s.size());
  for (Eigen::Index j = 0; j < input_s.size(); ++j)
    out.whole_input[j] = std::ceil(in_samples(input_s[j] + output_s[first], period_s));
  // Shifted so that no output delay is negative.
  const double least = out.whole_output.minCoeff();
  out.whole_output.array() -= least;
  out.whole_input.array() += least;
  // The sum of the delays of a channel decides, as in response(), not the sum of rounded parts.
  out.part_input.resize(input_s.size());
  out.rest.resize(output_s.size(), input_s.size());
  for (Eigen::Index j = 0; j < input_s.size(); ++j) {
    for (Eigen::Index i = 0; i < output_s.size(); ++i)
      out.rest(i, j) =
          in_samples(input_s[j] + output_s[i], period_s) - out.whole_output[i] - out.whole_input[j];
    out.part_input[j] = out.rest(first, j);
  }
  return out;
}

DividedDelays divide(const AdditiveModel& model, double period_s) {
  const Eigen::VectorXd input_s = model.input_delays_s();
  const Eigen::VectorXd output_s = model.output_delays_s();
  DividedDelays best = divide_from(0, input_s, output_s, period_s);
  for (Eigen::Index first = 1; first < output_s.size(); ++first) {
    DividedDelays other = divide_from(first, input_s, output_s, period_s);
    if (other.late_channels() < best.late_channels()) best = std::move(other);
  }
  return best;
}

/// f(A) of a block of the continuous A, from f and its derivative at the block's pole.
Eigen::MatrixXd function_of(const StateBlock& block, Complex value, Complex derivative) {
  if (block.size == 1) return Eigen::MatrixXd::Constant(1, 1, value.real());
  if (block.pole == 0.0)
    return Eigen::MatrixXd{{value.real(), derivative.real()}, {0.0, value.real()}};
  return Eigen::MatrixXd{{value.real(), -value.imag()}, {value.imag(), value.real()}};
}

Eigen::MatrixXd transition(const StateBlock& block, double t) {
  const Complex e = std::exp(block.pole * t);
  return function_of(block, e, t * e);
}

Eigen::MatrixXd held(const StateBlock& block, double t) {
  const HoldIntegral integral = hold_integral(block.pole, t);
  return function_of(block, integral.value, integral.derivative);
}

/// One block of the continuous system, sampled, and its share of h[0] and h[1].
void add_sampled(const StateSpace& continuous, const StateBlock& block, const DividedDelays& delays,
                 double period_s, StateSpace& out, Eigen::MatrixXd& late) {
  const auto B = continuous.B.middleRows(block.first, block.size);
  const auto C = continuous.C.middleCols(block.first, block.size);
  out.A.block(block.first, block.first, block.size, block.size) = transition(block, period_s);
  const Eigen::MatrixXd whole = held(block, period_s);
  for (Eigen::Index j = 0; j < B.cols(); ++j)
    out.B.block(block.first, j, block.size, 1) =
        transition(block, -delays.part_input[j] * period_s) * whole * B.col(j);
  for (Eigen::Index i = 0; i < C.rows(); ++i)
    out.C.block(i, block.first, 1, block.size) =
        C.row(i) * transition(block, -delays.part_output[i] * period_s);
  for (Eigen::Index j = 0; j < B.cols(); ++j)
    for (Eigen::Index i = 0; i < C.rows(); ++i) {
      const double rest = delays.rest(i, j);
      const double since = (rest > 0.0 ? 1.0 - rest : -rest) * period_s;
      const double seen = (C.row(i) * held(block, since) * B.col(j)).value();
      if (rest > 0.0) {
        late(i, j) += seen - (out.C.block(i, block.first, 1, block.size) *
                              out.B.block(block.first, j, block.size, 1))
                                 .value();
      } else {
        out.D(i, j) += seen;
      }
    }
  out.blocks.push_back({block.first, block.size, std::exp(block.pole * period_s), block.submodel});
}

/// States v[n+1] = Psi^T u[n] for late = Phi Psi^T, y = ... + Phi v.
void append_delay_states(const Eigen::MatrixXd& late, StateSpace& system) {
  const SingularShapes<double> shapes = singular_shapes(late);
  const Eigen::Index rank = numerical_rank(shapes.singular_value, shapes.singular_value[0]);
  const Eigen::Index order = system.order();
  const Eigen::Index all = order + rank;
  const Eigen::VectorXd root = shapes.singular_value.head(rank).cwiseSqrt();
  system.A.conservativeResizeLike(Eigen::MatrixXd::Zero(all, all));
  system.B.conservativeResize(all, Eigen::NoChange);
  system.C.conservativeResize(Eigen::NoChange, all);
  system.B.bottomRows(rank) = root.asDiagonal() * shapes.input.leftCols(rank).transpose();
  system.C.rightCols(rank) = shapes.output.leftCols(rank) * root.asDiagonal();
  for (Eigen::Index r = 0; r < rank; ++r) system.blocks.push_back({order + r, 1, 0.0, -1});
}

}  // namespace

SampledStateSpace sampled_state_space(const AdditiveModel& model) {
  if (!(model.sample_rate_hz > 0.0))
    fail_request(
        "model: a sampled state space needs a sample rate, but the model has none; set "
        "sample_rate_hz");
  const StateSpace continuous = state_space(model);
  const double period_s = 1.0 / model.sample_rate_hz;
  const DividedDelays delays = divide(model, period_s);

  SampledStateSpace out;
  out.sample_rate_hz = model.sample_rate_hz;
  out.input_delay_samples = delays.whole_input.cast<long long>();
  out.output_delay_samples = delays.whole_output.cast<long long>();
  StateSpace& system = out.system;
  system.A = Eigen::MatrixXd::Zero(continuous.order(), continuous.order());
  system.B.resizeLike(continuous.B);
  system.C.resizeLike(continuous.C);
  system.D = (delays.rest.array() > 0.0).select(0.0, continuous.D);
  Eigen::MatrixXd late = continuous.D - system.D;
  for (const StateBlock& block : continuous.blocks)
    add_sampled(continuous, block, delays, period_s, system, late);
  if (delays.late_channels() > 0) append_delay_states(late, system);
  return out;
}

}  // namespace stageid
