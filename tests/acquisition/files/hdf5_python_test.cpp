#include <gtest/gtest.h>

#include <complex>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "tests/support/process/python_script.hpp"

/// Reads files of h5py, and lets h5py read stageid's files.
namespace stageid::test_hdf5_python {

using Hdf5Python = test::PythonScriptTest;

TEST_F(Hdf5Python, ReadsTheAttributesOfH5py) {
  run(R"(
f = h5py.File('f.h5', 'w')
f.attrs['int'] = 40000
f.attrs['int32'] = np.int32(-3)
f.attrs['uint8'] = np.uint8(200)
f.attrs['float'] = 1.5
f.attrs['float32'] = np.float32(0.25)
f.attrs['true'] = np.bool_(True)
f.attrs['false'] = False
f.attrs['str'] = 'fünf'
f.attrs['bytes'] = np.bytes_('fixed')
f.attrs['strs'] = ['N', 'm', '']
f.attrs['fixed_strs'] = np.array([b'ab', b'c'])
f.attrs['one_str'] = ['only']
f.attrs['array'] = np.array([1, 2, 3], dtype='i2')
f.attrs['one'] = np.array([[7.0]])
f.attrs['empty'] = h5py.Empty('f')
)");
  const Hdf5File f = Hdf5File::open(directory / "f.h5");
  EXPECT_EQ(f.read_integer_attribute("/", "int"), 40000);
  EXPECT_EQ(f.read_real_attribute("/", "int"), 40000.0);
  EXPECT_EQ(f.read_integer_attribute("/", "int32"), -3);
  EXPECT_EQ(f.read_integer_attribute("/", "uint8"), 200);
  EXPECT_EQ(f.read_real_attribute("/", "float"), 1.5);
  EXPECT_EQ(f.read_real_attribute("/", "float32"), 0.25);
  EXPECT_EQ(f.read_integer_attribute("/", "true"), 1);
  EXPECT_EQ(f.read_real_attribute("/", "true"), 1.0);
  EXPECT_EQ(f.read_integer_attribute("/", "false"), 0);
  EXPECT_EQ(f.read_text_attribute("/", "str"), "f\xC3\xBCnf");
  EXPECT_EQ(f.read_text_attribute("/", "bytes"), "fixed");
  EXPECT_EQ(f.read_texts_attribute("/", "strs"), (std::vector<std::string>{"N", "m", ""}));
  EXPECT_EQ(f.read_texts_attribute("/", "fixed_strs"), (std::vector<std::string>{"ab", "c"}));
  EXPECT_EQ(f.read_text_attribute("/", "one_str"), "only");
  EXPECT_EQ(f.read_reals_attribute("/", "array"), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(f.read_real_attribute("/", "one"), 7.0);
  EXPECT_TRUE(f.read_reals_attribute("/", "empty").empty());
  EXPECT_THROW(f.read_real_attribute("/", "empty"), FormatError);
}

TEST_F(Hdf5Python, ReadsTheDatasetsOfH5py) {
  run(R"(
f = h5py.File('f.h5', 'w')
f['c128'] = np.array([[1+2j, 3-4j]])
f['c64'] = np.array([0.5-0.25j], dtype='c8')
f['i16'] = np.arange(-3, 3, dtype='i2').reshape(3, 2)
f['u64'] = np.array([2**63], dtype='u8')
f['big_endian'] = np.array([1.5, -2.5], dtype='>f8')
f['bool'] = np.array([True, False, True])
f['vlen'] = ['z1', 'zwölf']
f['fixed'] = np.array([b'z1', b'longer'])
f['fixed_utf8'] = np.array(['z1'.encode(), 'ü'.encode()], dtype=h5py.string_dtype('utf-8', 8))
f['other'] = np.zeros(2, dtype=[('a', 'f8'), ('b', 'i4')])
f['grid'] = np.array([[b'a']])
f.create_dataset('packed', data=np.arange(30000.0).reshape(-1, 3), compression='gzip', shuffle=True, chunks=(1000, 1))
f.create_dataset('zeros', shape=(4000000,), dtype='f8', compression='gzip', chunks=(1000000,))
f['zeros'][:] = 0
)");
  const Hdf5File f = Hdf5File::open(directory / "f.h5");
  using Complex = std::complex<double>;
  EXPECT_EQ(f.read_complex("/c128"), (std::vector<Complex>{{1, 2}, {3, -4}}));
  EXPECT_EQ(f.read_complex("/c64"), (std::vector<Complex>{{0.5, -0.25}}));
  EXPECT_EQ(f.read_reals("/i16"), (std::vector<double>{-3, -2, -1, 0, 1, 2}));
  EXPECT_EQ(f.kind("/i16"), Hdf5Kind::integer);
  double row[2];
  f.read_rows("/i16", 1, 1, row);
  EXPECT_EQ(row[0], -1.0);
  EXPECT_EQ(row[1], 0.0);
  EXPECT_EQ(f.read_reals("/u64"), std::vector<double>{0x1p63});
  EXPECT_EQ(f.read_reals("/big_endian"), (std::vector<double>{1.5, -2.5}));
  EXPECT_EQ(f.read_reals("/bool"), (std::vector<double>{1, 0, 1}));
  EXPECT_EQ(f.read_texts("/vlen"), (std::vector<std::string>{"z1", "zw\xC3\xB6lf"}));
  EXPECT_EQ(f.read_texts("/fixed"), (std::vector<std::string>{"z1", "longer"}));
  EXPECT_EQ(f.read_texts("/fixed_utf8"), (std::vector<std::string>{"z1", "\xC3\xBC"}));
  EXPECT_EQ(f.kind("/other"), Hdf5Kind::other);
  EXPECT_THROW(f.read_reals("/other"), FormatError);
  EXPECT_THROW(f.read_complex("/other"), FormatError);
  EXPECT_THROW(f.read_texts("/grid"), FormatError);
  // A shape that compresses a thousandfold is not damage.
  EXPECT_EQ(f.read_reals("/zeros").size(), 4'000'000U);

  std::vector<double> rows(9);
  for (const hsize_t first : {0, 998, 1999, 9997}) {
    f.read_rows("/packed", first, 3, rows.data());
    for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(rows[i], static_cast<double>(3 * first + i));
  }
}

TEST_F(Hdf5Python, IsReadByH5py) {
  {
    Hdf5File f = Hdf5File::create(directory / "f.h5");
    f.write_attribute("/", "format", std::string("stageid-test"));
    f.write_attribute("/", "rate", 2.5);
    f.write_attribute("/", "count", 7LL);
    f.write_attribute("/", "units", std::vector<std::string>{"N", "\xC2\xB5m"});
    const std::complex<double> values[2] = {{1, 2}, {3, -4}};
    f.write_complex("/c", {1, 2}, values);
    f.write_texts("/names", {"z1", "x"});
    f.create_growing("/rows", 2, H5T_IEEE_F64LE, 16);
    for (double i = 0; i < 100; ++i) {
      const double rows[2] = {i, -i};
      f.append_rows("/rows", 1, rows);
    }
    f.close();
  }
  run(R"(
f = h5py.File('f.h5', 'r')
assert f.attrs['format'] == 'stageid-test'
assert f.attrs['rate'] == 2.5 and f.attrs['count'] == 7
assert list(f.attrs['units']) == ['N', 'µm']
assert f['c'].dtype == np.complex128 and (f['c'][:] == [[1+2j, 3-4j]]).all()
assert list(f['names'].asstr()[:]) == ['z1', 'x']
n = np.arange(100.0)
assert (f['rows'][:] == np.stack([n, -n], axis=1)).all()
)");
}

TEST_F(Hdf5Python, AForeignProgramCanPlayAPlan) {
  ExperimentSpec spec;
  spec.scheme = ExcitationScheme::orthogonal_dft;
  spec.axes = {{"z1", 1.0, {}}, {"z2", 3.0, {}}, {"x1", 0.5, {}}};
  spec.seed = 5;
  const ExperimentPlan plan(FrequencyGrid::band(100.0, 60, {.low_hz = 2.0, .high_hz = 40.0}), spec);
  write_experiment_plan(directory / "plan.h5", plan);
  const Eigen::MatrixXd played = plan.excitation({1, 2});
  {
    Hdf5File f = Hdf5File::create(directory / "played.h5");
    f.write_reals("/columns", {3, 60}, played.data());  // column-major: one axis per row
    f.close();
  }
  run(R"(
f = h5py.File('plan.h5', 'r')
N = f.attrs['period_samples']; n = np.arange(N)
X = f['realizations/0001/spectrum'][:] * f['mixing'][:, 2][:, None]
x = 2 * (X @ np.exp(2j * np.pi * f['lines'][:][:, None] * n / N)).real
assert np.abs(x - h5py.File('played.h5', 'r')['columns'][:]).max() < 1e-12
A, phi = f['amplitude'][:], f['realizations/0001/phase_rad'][:]
assert np.abs(A / 2 * np.exp(1j * phi) - f['realizations/0001/spectrum'][:]).max() < 1e-15
assert np.abs(np.sqrt((x**2).mean(axis=1)) - f['level'][:]).max() < 1e-12
assert [a.decode() for a in f['axes'][:]] == ['z1', 'z2', 'x1']
assert int(f.attrs['seed']) == 5
)");
}

}  // namespace stageid::test_hdf5_python
