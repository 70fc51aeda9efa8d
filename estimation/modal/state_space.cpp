#include "estimation/modal/state_space.hpp"

#include "estimation/modal/singular_shapes.hpp"
#include "estimation/modal/submodel_residues.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// M = Phi Psi^T with columns of equal norm, so that neither B nor C carries all the magnitude.
template <typename Matrix>
struct Factors {
  Matrix output;  ///< n_y x rank
  Matrix input;   ///< n_u x rank
};

template <typename Scalar>
Factors<Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>> leading_factors(
    const SingularShapes<Scalar>& shapes, Eigen::Index rank) {
  const Eigen::VectorXd root = shapes.singular_value.head(rank).cwiseSqrt();
  return {shapes.output.leftCols(rank) * root.asDiagonal(),
          shapes.input.leftCols(rank) * root.asDiagonal()};
}

/// One block with the rows of B and columns of C that belong to it.
struct BlockPart {
  StateBlock block;
  Eigen::MatrixXd A;
  Eigen::MatrixXd B;
  Eigen::MatrixXd C;
};

BlockPart real_part(double pole, long long submodel, const Eigen::VectorXd& output,
                    const Eigen::VectorXd& input) {
  return {{0, 1, pole, submodel}, Eigen::MatrixXd::Constant(1, 1, pole), input.transpose(), output};
}

/// With the complex state z, z' = lambda z + psi^T u and y = 2 Re(phi z); x = [Re z; Im z].
BlockPart complex_part(Complex pole, long long submodel, const Eigen::VectorXcd& output,
                       const Eigen::VectorXcd& input) {
  BlockPart part{{0, 2, pole, submodel},
                 Eigen::MatrixXd{{pole.real(), -pole.imag()}, {pole.imag(), pole.real()}},
                 Eigen::MatrixXd(2, input.size()),
                 Eigen::MatrixXd(output.size(), 2)};
  part.B << input.real().transpose(), input.imag().transpose();
  part.C << 2.0 * output.real(), -2.0 * output.imag();
  return part;
}

/// A submodel and its place in the model.
struct Member {
  const Submodel& submodel;
  std::size_t index;

  long long id() const { return static_cast<long long>(index); }
  template <typename Matrix>
  auto factors(const Matrix& residue) const {
    const auto shapes = singular_shapes(residue);
    return leading_factors(shapes, residue_rank(submodel, index, shapes.singular_value));
  }
};

void add_poles(const Member& member, const SubmodelResidues& fractions,
               std::vector<BlockPart>& parts) {
  for (const PoleResidue& pole : fractions.poles) {
    if (pole.is_real()) {
      const auto f = member.factors(Eigen::MatrixXd(pole.residue.real()));
      for (Eigen::Index r = 0; r < f.input.cols(); ++r)
        parts.push_back(
            real_part(pole.pole_rad_s.real(), member.id(), f.output.col(r), f.input.col(r)));
    } else {
      const auto f = member.factors(pole.residue);
      for (Eigen::Index r = 0; r < f.input.cols(); ++r)
        parts.push_back(
            complex_part(pole.pole_rad_s, member.id(), f.output.col(r), f.input.col(r)));
    }
  }
}

/// R_1/s + R_2/s^2, R_2 = Phi Psi^T. Chains x_1' = x_2 + B_1 u, x_2' = Psi^T u, y = Phi x_1 + C_2 x_2
/// give Phi Psi^T/s^2 + (Phi B_1 + C_2 Psi^T)/s, which can be all of R_1 but its part outside the
/// columns and rows of R_2: that part has integrators of its own.
void add_integrators(const Member& member, const SubmodelResidues& fractions,
                     std::vector<BlockPart>& parts) {
  const Eigen::MatrixXd& R1 = fractions.integrator;
  const auto chain = member.factors(fractions.double_integrator);
  const Eigen::VectorXd inverse_norm =
      chain.output.colwise().squaredNorm().transpose().cwiseInverse();
  const Eigen::MatrixXd B1 = inverse_norm.asDiagonal() * chain.output.transpose() * R1;
  const Eigen::MatrixXd left = R1 - chain.output * B1;
  const Eigen::MatrixXd C2 = left * chain.input * inverse_norm.asDiagonal();
  const Eigen::MatrixXd rest = left - C2 * chain.input.transpose();
  for (Eigen::Index r = 0; r < chain.input.cols(); ++r) {
    BlockPart part{{0, 2, 0.0, member.id()},
                   Eigen::MatrixXd{{0.0, 1.0}, {0.0, 0.0}},
                   Eigen::MatrixXd(2, R1.cols()),
                   Eigen::MatrixXd(R1.rows(), 2)};
    part.B << B1.row(r), chain.input.col(r).transpose();
    part.C << chain.output.col(r), C2.col(r);
    parts.push_back(std::move(part));
  }
  const auto shapes = singular_shapes(rest);
  // Relative to R_1: what is left of it may be rounding alone.
  const auto single = leading_factors(shapes, numerical_rank(shapes.singular_value, R1.norm()));
  for (Eigen::Index r = 0; r < single.input.cols(); ++r)
    parts.push_back(real_part(0.0, member.id(), single.output.col(r), single.input.col(r)));
}

}  // namespace

StateSpace state_space(const AdditiveModel& model) {
  StateSpace out;
  out.D = Eigen::MatrixXd::Zero(model.n_outputs(), model.n_inputs());
  std::vector<BlockPart> parts;
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Member member{model.submodels[i], i};
    const SubmodelResidues fractions = residues(member.submodel, i);
    out.D += fractions.direct;
    add_integrators(member, fractions, parts);
    add_poles(member, fractions, parts);
  }
  Eigen::Index order = 0;
  for (BlockPart& part : parts) {
    part.block.first = order;
    order += part.block.size;
  }
  out.A = Eigen::MatrixXd::Zero(order, order);
  out.B.resize(order, model.n_inputs());
  out.C.resize(model.n_outputs(), order);
  for (const BlockPart& part : parts) {
    const auto [first, size, pole, submodel] = part.block;
    out.A.block(first, first, size, size) = part.A;
    out.B.middleRows(first, size) = part.B;
    out.C.middleCols(first, size) = part.C;
    out.blocks.push_back(part.block);
  }
  return out;
}

}  // namespace stageid
