#include "frf/wiring/plant_lines.hpp"

#include <complex>
#include <numbers>

#include "frf/response/line_estimate.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

std::vector<Index> picked(const std::vector<Index>& all, const std::vector<Index>& wanted) {
  std::vector<Index> some;
  for (const Index i : wanted) some.push_back(all[i]);
  return some;
}

/// Phase factor e^{j phi} of hold and delay: without it, the largest entry of a free rigid body is -1 / omega^2 or
/// +1 / omega^2.
std::complex<double> nominal_turn(const Eigen::MatrixXcd& G0) {
  Index row = 0;
  Index column = 0;
  const double largest = G0.cwiseAbs().maxCoeff(&row, &column);
  const std::complex<double> turn = -G0(row, column) / largest;
  // Hold and delay turn by less than 90 degrees in the band of the rigid body; beyond it, the sign of the whole matrix
  // does not matter.
  return turn.real() < 0.0 ? -turn : turn;
}

}  // namespace

std::vector<PlantLine> plant_lines(const HealthRecord& record, const NominalStage& nominal,
                                   const std::vector<Index>& outputs,
                                   const std::vector<Index>& inputs) {
  const auto y = picked(positions_in(nominal.sensors, record.info.sensors.names), outputs);
  const auto u = picked(positions_in(nominal.actuators, record.info.actuators.names), inputs);
  std::vector<Index> rows = outputs;
  for (const Index a : inputs) rows.push_back(record.n_y() + a);
  const Eigen::VectorXd periods =
      Eigen::Map<const Eigen::VectorXi>(record.periods.data(), record.experiments()).cast<double>();
  std::vector<PlantLine> lines;
  for (Index k = 0; k < record.frequency_hz.size(); ++k) {
    const double frequency_hz = record.frequency_hz[k];
    if (frequency_hz < nominal.free_from_hz) continue;
    const LineRecord& at = record.lines[k];
    const Eigen::MatrixXcd Z = at.Z(rows, Eigen::all);
    const LineEstimate estimate =
        estimate_line(at.R(record.axes, Eigen::all), record.mean(Z), std::ssize(outputs));
    if (estimate.status != LineStatus::good) continue;
    PlantLine line;
    line.omega_rad_s = 2.0 * std::numbers::pi * frequency_hz;
    line.G0 = nominal.rigid_body(frequency_hz)(y, u);
    const std::complex<double> back = std::conj(nominal_turn(line.G0));
    line.G0 *= back;
    line.G = back * estimate.G;
    line.variance.setZero(line.G.rows(), line.G.cols());
    if (record.scatter_dof() > 0) {
      const LineNoise noise =
          line_noise(estimate, record.scatter(Z), record.scatter_dof(), periods);
      line.variance =
          noise.residual.diagonal().real() * noise.input_part.diagonal().real().transpose();
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace stageid
