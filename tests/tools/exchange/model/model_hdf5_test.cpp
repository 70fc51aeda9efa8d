#include "tools/exchange/model/model_hdf5.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "tests/support/process/python_script.hpp"

/// State space, modes and rigid body of an exported model, as another program reads them.
namespace stageid::test_model_hdf5 {

/// 2 x 3: a rigid body of rank 2, a mode of rank one with shapes and mass as written here, one with
/// free residues B_0 + B_1 s, and a compliance.
AdditiveModel exported_model() {
  AdditiveModel model;
  model.inputs = {{"a1", "a2", "a3"}, {"N", "N", "N"}};
  model.outputs = {{"y1", "y2"}, {"m", "m"}};
  model.sample_rate_hz = 1000.0;
  model.hold = HoldModel::exact;
  model.input_delay_s = Eigen::VectorXd{{0.0004, 0.0021, 0.0}};
  model.output_delay_s = Eigen::VectorXd{{0.0, 0.0003}};
  Submodel rigid;
  rigid.integrators = 2;
  rigid.numerator = {Eigen::MatrixXd{{0.1, 0.2, 0.3}, {0.4, 0.5, -0.6}}};
  const double omega = 2.0 * std::numbers::pi * 50.0;
  Submodel mode;
  mode.denominator = {1.0, 2.0 * 0.02 / omega, 1.0 / (omega * omega)};
  const Eigen::VectorXd output{{0.6, 0.8}};
  const Eigen::VectorXd input{{1.0 / 3.0, 2.0 / 3.0, -2.0 / 3.0}};
  mode.numerator = {output * input.transpose() / (5.0 * omega * omega)};
  mode.residue_rank = 1;
  Submodel free;
  free.denominator = {1.0, 1e-4, 1e-6};
  free.numerator = {Eigen::MatrixXd{{1.0, 2.0, 3.0}, {4.0, -5.0, 6.0}} * 1e-6,
                    Eigen::MatrixXd{{7.0, 8.0, -9.0}, {1.0, 1.0, 2.0}} * 1e-9};
  Submodel compliance;
  compliance.numerator = {Eigen::MatrixXd{{3.0, 2.0, 1.0}, {1.0, 2.0, 4.0}} * 1e-7};
  model.submodels = {rigid, mode, free, compliance};
  return model;
}

struct ModelHdf5 : test::PythonScriptTest {
  ModelHdf5() : PythonScriptTest("h5py, numpy as np, scipy.signal") {}

  void write(const AdditiveModel& model, const std::optional<DrivingPoint>& point = {}) const {
    write_model_hdf5(directory / "m.h5", model, {Eigen::VectorXd{{1.0, 40.0, 160.0, 480.0}}, {}},
                     point);
  }
};

TEST_F(ModelHdf5, BothStateSpacesHaveTheModelsResponse) {
  // /response of hold exact is the sampled one; with hold none, the continuous one.
  AdditiveModel model = exported_model();
  write(model);
  run(R"(
f = h5py.File('m.h5', 'r')
g = f['state_space/discrete']
A, B, C, D = (g[n][:] for n in 'ABCD')
u, y = g['input_delay_samples'][:], g['output_delay_samples'][:]
assert len(A) >= 2 * 2 + 2 + 4 and (u >= 0).all() and (y >= 0).all()
for hz, P in zip(f['frequency_hz'], f['response']):
    z = np.exp(2j * np.pi * hz / g.attrs['sample_rate_hz'])
    found = C @ np.linalg.solve(z * np.eye(len(A)) - A, B) + D
    found = z ** -y.astype(float)[:, None] * found * z ** -u.astype(float)
    assert np.linalg.norm(found - P) < 1e-10 * np.linalg.norm(P), (hz, found, P)
assert np.allclose(np.diag(A)[g['submodel'][:] == -1], 0)
)");
  model.hold = HoldModel::none;
  write(model);
  run(R"(
f = h5py.File('m.h5', 'r')
g = f['state_space/continuous']
A, B, C, D = (g[n][:] for n in 'ABCD')
assert A.shape == (10, 10) and B.shape == (10, 3) and C.shape == (2, 10)
assert list(g['submodel']) == [0] * 4 + [1] * 2 + [2] * 4
key = lambda x: (round(x.real, 6), round(x.imag, 6))
poles = sorted(g['pole_rad_s'][:], key=key)
assert np.allclose(poles, sorted(np.linalg.eigvals(A), key=key), rtol=1e-9, atol=1e-6)
for hz, P in zip(f['frequency_hz'], f['response']):
    s = 2j * np.pi * hz
    found = C @ np.linalg.solve(s * np.eye(10) - A, B) + D
    found = np.exp(-s * f['output_delay_s'][:])[:, None] * found * np.exp(-s * f['input_delay_s'][:])
    assert np.linalg.norm(found - P) < 1e-12 * np.linalg.norm(P)
)");
}

TEST_F(ModelHdf5, WithoutDelaysTheSampledMatricesAreScipys) {
  AdditiveModel model = exported_model();
  model.input_delay_s.setZero();
  model.output_delay_s.setZero();
  write(model);
  run(R"(
f = h5py.File('m.h5', 'r')
c, d = f['state_space/continuous'], f['state_space/discrete']
expected = scipy.signal.cont2discrete(tuple(c[n][:] for n in 'ABCD'), 1e-3, 'zoh')
for name, matrix in zip('ABCD', expected):
    assert np.linalg.norm(d[name][:] - matrix) < 1e-12 * np.linalg.norm(matrix), name
assert (d['input_delay_samples'][:] == 0).all()
)");
}

TEST_F(ModelHdf5, HoldsModesAndRigidBody) {
  write(exported_model(), DrivingPoint{1, 1});
  run(R"(
f = h5py.File('m.h5', 'r')
m, r = f['modes'], f['rigid_body']
phi, psi = m['output_shape'][:], m['input_shape'][:]
assert phi.shape == (2, 2) and psi.shape == (2, 3)
assert np.allclose(phi[0], [.6, .8]) and np.allclose(psi[0], [1/3, 2/3, -2/3])
assert np.allclose(m['modal_mass'][0], 5) and m['not_rank_one'][0] < 1e-12
assert np.allclose(m['driving_point_mass'][0], 5 / (.8 * 2/3))
assert m['driving_point_mass'].attrs['output'] == 'y2'
assert m['driving_point_mass'].attrs['input'] == 'a2'
# The free residue from the submodel itself.
s = f['submodels/0002']; a = s['denominator'][:]
pole = max(np.roots(a[::-1]), key=lambda x: x.imag)
B = s['numerator'][:]
values = np.linalg.svd((B[0] + pole * B[1]) / a[2], compute_uv=False)
assert np.allclose(m['modal_mass'][1], 1 / values[0])
assert np.allclose(m['not_rank_one'][1], values[1] / values[0])
mac = lambda x: np.abs(x.conj() @ x.T) ** 2
assert np.allclose(m['output_mac'], mac(phi)) and np.allclose(m['input_mac'], mac(psi))
assert np.allclose(np.diag(m['output_mac']), 1)
sum_ = r['output_shape'][:].T @ np.diag(1 / r['mass'][:]) @ r['input_shape'][:]
assert np.allclose(sum_, f['submodels/0000/numerator'][0])
assert np.allclose(np.linalg.norm(r['input_shape'], axis=1), 1)
)");
}

TEST(ModelHdf5Content, WithoutASampleRateThereIsNoSampledSystem) {
  const test::TemporaryDirectory directory;
  AdditiveModel model = exported_model();
  model.sample_rate_hz = 0.0;
  model.hold = HoldModel::none;
  write_model_hdf5(directory / "m.h5", model, {}, {});
  const Hdf5File file = Hdf5File::open(directory / "m.h5");
  EXPECT_TRUE(file.exists("/state_space/continuous/A"));
  EXPECT_FALSE(file.exists("/state_space/discrete"));
  EXPECT_FALSE(file.exists("/modes/driving_point_mass"));
}

TEST(ModelHdf5Content, AModelOfADirectTermAloneHasEmptyMatrices) {
  const test::TemporaryDirectory directory;
  AdditiveModel model = exported_model();
  model.submodels = {model.submodels.back()};
  model.output_delay_s.setZero();
  write_model_hdf5(directory / "m.h5", model, {}, {});
  const Hdf5File file = Hdf5File::open(directory / "m.h5");
  EXPECT_EQ(file.shape("/state_space/discrete/A"), (std::vector<hsize_t>{0, 0}));
  EXPECT_EQ(file.shape("/state_space/continuous/B"), (std::vector<hsize_t>{0, 3}));
  EXPECT_EQ(file.shape("/modes/output_shape"), (std::vector<hsize_t>{0, 2}));
  EXPECT_EQ(file.shape("/rigid_body/input_shape"), (std::vector<hsize_t>{0, 3}));
  EXPECT_EQ(file.shape("/rigid_body/mass"), (std::vector<hsize_t>{0}));
}

TEST(ModelHdf5Content, WhatHasNoStateSpaceIsRefusedAndLeavesNothing) {
  const test::TemporaryDirectory directory;
  AdditiveModel model = exported_model();
  model.submodels[2].denominator = {1.0, 2e-3, 1e-6};  // (1 + s/1000)^2
  EXPECT_THROW(write_model_hdf5(directory / "m.h5", model, {}, {}), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(directory / "m.h5"));
  EXPECT_THROW(write_model_hdf5(directory / "m.h5", exported_model(), {}, DrivingPoint{0, 3}),
               std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(directory / "m.h5"));
  EXPECT_THROW(write_model_hdf5(directory / "none" / "m.h5", exported_model(), {}, {}), FileError);
}

}  // namespace stageid::test_model_hdf5
