#include "estimation/modal/modal_assurance.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

constexpr double kLeastMac = 0.1;  // of the residues; modes with less similar shapes are not paired

struct Candidate {
  ModePair pair;
  double worth = 0.0;
};

Eigen::MatrixXcd as_columns(const std::vector<ModeShape>& modes,
                            Eigen::VectorXcd ModeShape::*shape) {
  Eigen::MatrixXcd out(modes.empty() ? 0 : (modes[0].*shape).size(), std::ssize(modes));
  for (std::size_t m = 0; m < modes.size(); ++m) out.col(m) = modes[m].*shape;
  return out;
}

std::vector<Candidate> candidates(const std::vector<ModeShape>& first,
                                  const std::vector<ModeShape>& second) {
  const Eigen::MatrixXd output_mac = modal_assurance(output_shapes(first), output_shapes(second));
  const Eigen::MatrixXd input_mac = modal_assurance(input_shapes(first), input_shapes(second));
  std::vector<Candidate> out;
  for (std::size_t a = 0; a < first.size(); ++a)
    for (std::size_t b = 0; b < second.size(); ++b) {
      const double difference =
          second[b].natural_frequency_hz / first[a].natural_frequency_hz - 1.0;
      const ModePair pair{a, b, difference, output_mac(a, b), input_mac(a, b)};
      const double mac = pair.output_mac * pair.input_mac;
      const double nearness = 1.0 - std::abs(difference) / kMostModeDifference;
      if (nearness >= 0.0 && mac >= kLeastMac) out.push_back({pair, mac * nearness});
    }
  return out;
}

}  // namespace

Eigen::MatrixXd modal_assurance(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b) {
  if (a.rows() != b.rows()) fail_request("MAC: both sets of shapes must have the same channels");
  Eigen::MatrixXd mac = (a.adjoint() * b).cwiseAbs2();
  for (Eigen::Index i = 0; i < mac.rows(); ++i)
    for (Eigen::Index j = 0; j < mac.cols(); ++j)
      if (mac(i, j) > 0.0) mac(i, j) /= a.col(i).squaredNorm() * b.col(j).squaredNorm();
  return mac;
}

Eigen::MatrixXcd output_shapes(const std::vector<ModeShape>& modes) {
  return as_columns(modes, &ModeShape::output_shape);
}

Eigen::MatrixXcd input_shapes(const std::vector<ModeShape>& modes) {
  return as_columns(modes, &ModeShape::input_shape);
}

std::vector<ModePair> pair_modes(const std::vector<ModeShape>& first,
                                 const std::vector<ModeShape>& second) {
  if (first.empty() || second.empty()) return {};
  std::vector<Candidate> sorted = candidates(first, second);
  std::ranges::stable_sort(sorted, std::greater<>(), &Candidate::worth);
  std::vector<bool> first_taken(first.size(), false);
  std::vector<bool> second_taken(second.size(), false);
  std::vector<ModePair> out;
  for (const Candidate& candidate : sorted) {
    const ModePair& pair = candidate.pair;
    if (first_taken[pair.first] || second_taken[pair.second]) continue;
    first_taken[pair.first] = second_taken[pair.second] = true;
    out.push_back(pair);
  }
  std::ranges::sort(out, {}, &ModePair::first);
  return out;
}

}  // namespace stageid
