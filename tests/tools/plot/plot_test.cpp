// Pictures for print show the data in the files, for any names of the channels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdlib>
#include <map>
#include <numbers>
#include <sstream>

#include "acquisition/files/file_error.hpp"
#include "estimation/modal/validation.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "frf/file/frf_file.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tests/tools/report/synthetic_report.hpp"
#include "tools/plot/gnuplot.hpp"
#include "tools/plot/response_pictures.hpp"
#include "tools/report/report_input.hpp"

namespace stageid::test {
namespace test_plot {

using testing::HasSubstr;

/// The numbers of a table by the names of its columns, as gnuplot reads them.
std::map<std::string, std::vector<double>> table_of(const Picture& picture,
                                                    const std::string& name) {
  std::map<std::string, std::vector<double>> columns;
  for (const Picture::Table& table : picture.tables) {
    if (table.name != name) continue;
    std::istringstream lines(table.text);
    std::vector<std::string> names;
    std::string line;
    std::getline(lines, line);
    std::istringstream head(line.substr(1));
    for (std::string word; head >> word;) names.push_back(word);
    while (std::getline(lines, line)) {
      std::istringstream row(line);
      std::string word;
      for (const std::string& column : names)
        if (row >> word) columns[column].push_back(std::stod(word));
    }
  }
  return columns;
}

template <typename Values>
std::vector<double> listed(const Values& values) {
  const Eigen::VectorXd column = values.reshaped();
  return {column.begin(), column.end()};
}

/// Of a PNG: four bytes behind the name of its first chunk.
unsigned png_width(const std::string& bytes) {
  unsigned value = 0;
  for (std::size_t at = 16; at < 20; ++at)
    value = 256 * value + static_cast<unsigned char>(bytes.at(at));
  return value;
}

struct Plot : ProgramTest {
  ReportData read(bool with_model) const {
    ReportInput input;
    input.frf = at("frf.h5");
    if (with_model) input.model = at("model.json");
    return read_response_data(input);
  }
};

TEST_F(Plot, StyleAndBandAreThoseThatAreAskedFor) {
  make_model();
  const auto width = [&](const std::string& more) {
    succeed("plot cmif frf.h5 -o styled.png " + more);
    return png_width(read_bytes(at("styled.png")));
  };
  EXPECT_NEAR(width("--preset single"), 3.5 * 300, 2);
  EXPECT_NEAR(width("--preset double"), 7.16 * 300, 2);
  EXPECT_NEAR(width("--width 127 --height 50 --font Times --font-size 10"), 5.0 * 300, 2);
  succeed("plot bode frf.h5 -o grey.svg --theme grey --band 100 400");
  const std::string svg = read_bytes(at("grey.svg"));
  EXPECT_EQ(svg.find("rgb(240, 160,  48)"), std::string::npos);  // of the measurement
  EXPECT_NE(svg.find("rgb(171, 171, 171)"), std::string::npos);  // 0.299, 0.587 and 0.114 of it
  fail("plot cmif frf.h5 -o x.pdf --width 5", 2, "expected 30 to 1000");
  fail("plot cmif frf.h5 -o x.pdf --font-size 1", 2, "expected 4 to 40");
  fail("plot cmif frf.h5 -o x.pdf --font a'b", 2, "name of a font");
  fail("plot cmif frf.h5 -o x.pdf --preset triple", 2, "triple");
}

/// What is drawn on the first page.
std::string content_of_pdf(const std::string& pdf) {
  const std::size_t begin = pdf.find("stream\n") + 7;
  std::string content(std::size_t{1} << 24, '\0');
  uLongf size = content.size();
  const auto* const from = reinterpret_cast<const Bytef*>(pdf.data() + begin);
  const std::size_t length = pdf.find("endstream", begin) - begin;
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(content.data()), &size, from, length), Z_OK);
  content.resize(size);
  return content;
}

TEST_F(Plot, WidthsOfLinesAreInPointsInEveryFormat) {
  make_model();
  for (const std::string file : {"widths.pdf", "widths.svg"})
    succeed("plot cmif frf.h5 -o " + file);
  EXPECT_THAT(content_of_pdf(read_bytes(at("widths.pdf"))),
              AllOf(HasSubstr(" 0.5 w\n"), HasSubstr(" 1 w\n")));  // the frame, the first curve
  EXPECT_THAT(read_bytes(at("widths.svg")),
              AllOf(HasSubstr("stroke-width=\"0.67\""), HasSubstr("stroke-width=\"1.33\"")));
}

TEST_F(Plot, TheEntryHasThePhaseOfTheData) {
  make_frf();
  const ReportData data = read(false);
  const Picture picture = entry_picture(data, 1, 2);
  const auto phase = table_of(picture, "phase.txt").at("measured_deg");
  const Eigen::Index channel = 1 + data.frf->n_outputs() * 2;
  int missing = 0;
  for (std::size_t k = 0; k < phase.size(); ++k) {
    const double degrees = std::arg(data.frf->response(channel, static_cast<Eigen::Index>(k))) *
                           180.0 / std::numbers::pi;
    if (std::isnan(phase[k]))
      ++missing;
    else
      EXPECT_NEAR(phase[k], degrees, 1e-9);
  }
  EXPECT_LT(missing, 10) << "where it passes 180 degrees";
  EXPECT_THAT(picture.script, HasSubstr("Phase [°]"));
}

TEST_F(Plot, ASmallExperimentIsDrawnInAllFormatsAndTwiceTheSame) {
  make_model();
  const std::string inputs = " frf.h5 model.json ";
  for (const std::string& figure : {"cmif" + inputs, "bode" + inputs,
                                    "entry" + inputs + "--output-channel s2 --input-channel a3 "})
    for (const std::string ending : {".pdf", ".svg", ".png"}) {
      SCOPED_TRACE(figure + ending);
      const std::string command = "plot " + figure + "-o ";
      EXPECT_THAT(succeed(command + "one" + ending).out, HasSubstr("wrote one" + ending));
      succeed(command + "two" + ending);
      const std::string bytes = read_bytes(at("one" + ending));
      EXPECT_TRUE(same_bytes(bytes, read_bytes(at("two" + ending))));
      if (ending == ".pdf") {
        EXPECT_THAT(bytes, testing::StartsWith("%PDF-"));
        EXPECT_THAT(bytes, HasSubstr("(D:19700101000000"));
      } else if (ending == ".svg") {
        EXPECT_THAT(bytes, HasSubstr("Frequency [Hz]"));
      } else {
        EXPECT_GE(png_width(bytes), 1050u);  // 3.5 in at 300 dots per inch
      }
    }
}

TEST_F(Plot, AnEntryIsDrawnFromTheNumbersOfTheFiles) {
  make_model();
  const FrfEstimate file = read_frf(at("frf.h5"));
  const ReportData data = read(true);
  const FrfEstimate& frf = *data.frf;
  const Eigen::Index lines = (file.frequency_hz.array() >= 120.0).count();  // the model's band
  const auto table = table_of(entry_picture(data, 1, 2), "entry.txt");
  const Eigen::Index channel = 1 + file.n_outputs() * 2;
  EXPECT_EQ(table.at("frequency_hz"), listed(file.frequency_hz.tail(lines)));
  EXPECT_EQ(table.at("measured"), listed(file.response.row(channel).tail(lines).cwiseAbs()));
  ASSERT_EQ(table.at("deviation").size(), static_cast<std::size_t>(lines));
  const Eigen::MatrixXcd model = response_like(read_model(at("model.json")), frf);
  for (Eigen::Index k = 0; k < lines; ++k) {
    const Eigen::Index line = file.lines() - lines + k;
    const std::complex<double> modelled = model(channel, k);
    EXPECT_NEAR(table.at("model")[k], std::abs(modelled), 1e-12 * std::abs(modelled));
    EXPECT_NEAR(table.at("residual")[k], std::abs(file.response(channel, line) - modelled),
                1e-12 * std::abs(modelled));
    // Two realizations: their scatter is too uncertain, the noise is shown.
    EXPECT_NEAR(table.at("deviation")[k], std::sqrt(file.noise_variance(channel, line)), 1e-25);
  }
}

TEST_F(Plot, TheMatrixHoldsThePanelsThatWereAskedFor) {
  make_frf();
  const FrfEstimate file = read_frf(at("frf.h5"));
  const Picture picture = bode_picture(read(false), {1, 0}, {1});
  ASSERT_EQ(picture.tables.size(), 2u);
  for (const Eigen::Index output : {1, 0}) {
    const auto table = table_of(picture, std::to_string(output) + "_1.txt");
    EXPECT_EQ(table.size(), 2u);  // no model
    EXPECT_EQ(table.at("measured"),
              listed(file.response.row(output + file.n_outputs()).cwiseAbs()));
  }
}

TEST_F(Plot, TheModeIndicatorHasItsCurvesAndAMarkForEveryMode) {
  make_frf();
  const FrfEstimate file = read_frf(at("frf.h5"));
  ReportData data = read(false);
  data.chosen_modes = {{file.frequency_hz[10] + 1e-3, 0.01, 1},
                       {file.frequency_hz[20] - 1e-3, 0.01, 2},
                       {1e6, 0.01, 1}};  // outside the lines: cannot be marked
  const Picture picture = cmif_picture(data);
  const auto curves = table_of(picture, "cmif.txt");
  const Eigen::Index n = std::min(file.n_outputs(), file.n_inputs());
  ASSERT_EQ(curves.size(), static_cast<std::size_t>(n) + 1);
  for (const Eigen::Index k : {0, 10, 100}) {  // largest first: of omega^2 G, by its own SVD
    const double omega = file.omega_rad_s()[k];
    const Eigen::VectorXd s = svd(Eigen::MatrixXcd(omega * omega * file.at(k)), 0).singularValues();
    for (Eigen::Index i = 0; i < n; ++i)
      EXPECT_NEAR(curves.at("curve_" + std::to_string(i + 1))[k], s[i] * s[i], 1e-10 * s[0] * s[0]);
  }
  const auto marks = table_of(picture, "modes.txt");
  EXPECT_EQ(marks.at("frequency_hz"),
            (std::vector{file.frequency_hz[10] + 1e-3, file.frequency_hz[20] - 1e-3}));
  EXPECT_THAT(picture.script, HasSubstr("candidates (2)"));
  EXPECT_EQ(marks.at("value"), (std::vector{curves.at("curve_1")[10], curves.at("curve_2")[20]}));
}

TEST_F(Plot, NamesOfChannelsAreNeverCommands) {
  FrfEstimate frf = *synthetic_report({.outputs = 1, .inputs = 2, .lines = 60, .modes = 2}).frf;
  const std::string evil = "a'\n!touch caught\n`touch caught`\"$(touch caught) %s {/=99 x}\xff\x01";
  frf.inputs.names = {evil, "`touch caught`"};
  frf.inputs.units = {evil, "'; system('touch caught') #"};
  frf.outputs.names = {"z_1^{2}\\"};
  const TemporaryDirectory here;
  ReportData data;
  data.frf = frf;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(here.path());
  draw(entry_picture(data, 0, 0), here / "a.svg");
  draw(entry_picture(data, 0, 1), here / "b.svg");
  draw(bode_picture(data, {0}, {0, 1}), here / "c.svg");
  std::filesystem::current_path(before);
  EXPECT_EQ(snapshot(here.path()).size(), 3u);                      // the pictures, nothing else
  EXPECT_THAT(read_bytes(here / "c.svg"), HasSubstr("z_1^{2}\\"));  // and as it was written
}

TEST_F(Plot, NothingIsLeftInTheTemporaryDirectory) {
  make_frf();
  std::filesystem::create_directory(at("tmp"));
  const char* const old = std::getenv("TMPDIR");
  const std::string kept = old == nullptr ? "" : old;
  ::setenv("TMPDIR", name("tmp").c_str(), 1);
  succeed("plot cmif " + name("frf.h5") + " -o " + name("c.svg"));
  ProgramOptions full;
  full.largest_file_bytes = 2000;
  fail("plot cmif " + name("frf.h5") + " -o " + name("full.pdf"), 1, "stageid-plot-", full);
  full.largest_file_bytes = 20000;  // the tables fit, the picture does not
  fail("plot entry " + name("frf.h5") + " --output-channel s1 --input-channel a1 -o " +
           name("full.png"),
       1, "full.png: gnuplot failed", full);
  ::setenv("TMPDIR", name("no_such").c_str(), 1);
  fail("plot cmif " + name("frf.h5") + " -o " + name("d.pdf"), 1, "");
  old == nullptr ? ::unsetenv("TMPDIR") : ::setenv("TMPDIR", kept.c_str(), 1);
  EXPECT_TRUE(std::filesystem::is_empty(at("tmp")));
}

TEST_F(Plot, RequestsThatAreWrong) {
  make_model();
  const auto wrong = [&](const std::string& words, const std::string& text) {
    fail("plot " + words, 2, text);
  };
  const std::string frf = name("frf.h5");
  const std::string out = name("p.pdf");
  wrong("cmif -o " + out, "inputs");
  wrong("cmif " + frf + " --input-channel a1 -o " + out, "are for bode and entry");
  wrong("entry " + frf + " " + frf + " -o " + out, "duplicate file");
  for (const char* copy : {"b.h5", "c.h5"}) std::filesystem::copy_file(frf, at(copy));
  wrong("entry " + frf + " " + name("b.h5") + " " + name("c.h5") + " -o " + out,
        "is of the same kind");
  fail("plot cmif " + frf + " -o " + name("no/p.pdf"), 1, "no/p.pdf");
  std::filesystem::create_directory(at("folder.pdf"));
  fail("plot cmif " + frf + " -o " + name("folder.pdf"), 1, "is a directory");
}

TEST(Pictures, RefuseWhatCannotBeDrawn) {
  EXPECT_THROW(cmif_picture({}), std::invalid_argument);
  EXPECT_THROW(bode_picture({}, {0}, {0}), std::invalid_argument);
  EXPECT_THROW(entry_picture({}, 0, 0), std::invalid_argument);
  EXPECT_THROW(table_text({{"a", Eigen::VectorXd(2)}, {"b", Eigen::VectorXd(3)}}),
               std::invalid_argument);
  ReportData data = synthetic_report({.outputs = 1, .inputs = 1, .lines = 60, .modes = 1});
  const std::vector<Eigen::Index> many(41, 0);
  EXPECT_THROW(bode_picture(data, many, {0}), std::invalid_argument);
  EXPECT_THROW(bode_picture(data, {0}, many), std::invalid_argument);
  const TemporaryDirectory here;
  EXPECT_THROW(draw({1.0, 1.0, "plot nonsense(\n", {}}, here / "x.pdf"), FileError);
  EXPECT_TRUE(std::filesystem::is_empty(here.path()));
}

TEST(Pictures, NumbersSurviveTheTable) {
  const Eigen::VectorXd values{{0.1, 1.0 / 3.0, 4.9e-324, -1.7976931348623157e308}};
  std::istringstream lines(table_text({{"x", values}}));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "# x");
  for (const double value : values) {
    std::getline(lines, line);
    EXPECT_EQ(std::strtod(line.c_str(), nullptr), value);
  }
}

TEST(Pictures, AxesHoldTheDataAndLabelsThatFit) {
  EXPECT_THAT(frequency_axis(16.0, 800.0, 3.0), HasSubstr("('20' 20, '50' 50, '100' 100"));
  EXPECT_THAT(frequency_axis(16.0, 800.0, 3.0), HasSubstr("'' 30 1, '' 40 1"));
  EXPECT_THAT(magnitude_axis(3e-9, 2e-4, 2.0), HasSubstr("'10^{−9}' 1e-9"));
  EXPECT_THAT(frequency_axis(0.25, 2000.0, 0.5), HasSubstr("set xtics ('1' 1, '1000' 1000,"));
  EXPECT_THAT(magnitude_axis(3e-9, 2e-4, 2.0), HasSubstr("set yrange [1e-9:1e-3]"));
  EXPECT_THAT(magnitude_axis(3e-9, 2e-4, 0.9, false), HasSubstr("('' 1e-9, '' 1e-7"));
  const auto [low, high] = magnitude_range(Eigen::VectorXd{{0.0, 3.0, -1.0, 2.0}});
  EXPECT_EQ(low, 2.0);
  EXPECT_EQ(high, 3.0);
  EXPECT_EQ(magnitude_range(Eigen::VectorXd::Zero(3)), std::pair(1.0, 10.0));
}

}  // namespace test_plot
}  // namespace stageid::test
