#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/input_files.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/tools/report/packed_reader.hpp"
#include "tests/tools/report/synthetic_report.hpp"
#include "tools/report/report_page.hpp"

namespace stageid::test_report_page {

using nlohmann::json;
using testing::HasSubstr;

ReportData small() {
  return test::synthetic_report({.outputs = 2, .inputs = 3, .lines = 50, .modes = 3});
}

/// Text between the tag with that id and the next "</script>", as a browser reads it.
std::string element(const std::string& page, const std::string& id) {
  const std::size_t tag = page.find("id=\"" + id + "\">");
  if (tag == std::string::npos) return "";
  const std::size_t begin = page.find('>', tag) + 1;
  return page.substr(begin, page.find("</script>", begin) - begin);
}

json content(const std::string& page) { return json::parse(element(page, "content")); }

std::size_t count(const std::string& page, const std::string& what) {
  std::size_t found = 0;
  for (std::size_t at = page.find(what); at != std::string::npos; at = page.find(what, at + 1))
    ++found;
  return found;
}

template <typename Change>
std::string refusal(Change change) {
  ReportData data = small();
  change(data);
  return test::error_message<std::invalid_argument>([&] { report_page(data); });
}

TEST(Report, HoldsTheResponseAsFloat32ChannelAfterChannel) {
  const ReportData data = small();
  const std::string page = report_page(data);
  const json arrays = content(page)["arrays"];
  EXPECT_EQ(arrays["response"]["base"], "residual");
  const auto residual = test::unpacked_block16(element(page, "data-residual"));
  const auto numbers =
      test::unpacked_float32(element(page, "data-response"), arrays["response"]["order"], residual);
  ASSERT_EQ(numbers.size(), 6u * 50u);
  std::size_t at = 0;
  for (Eigen::Index channel = 0; channel < 6; ++channel)
    for (Eigen::Index k = 0; k < 50; ++k) {
      EXPECT_EQ(numbers[at].real(), static_cast<float>(data.frf->response(channel, k).real()));
      EXPECT_EQ(numbers[at++].imag(), static_cast<float>(data.frf->response(channel, k).imag()));
    }
  const auto frequency = test::packed_numbers<double>(element(page, "data-frequency"));
  EXPECT_EQ(frequency,
            std::vector<double>(data.frf->frequency_hz.begin(), data.frf->frequency_hz.end()));
}

TEST(Report, DescribesEveryBlockItHolds) {
  const std::string page = report_page(small());
  const json arrays = content(page)["arrays"];
  for (const char* id : {"frequency", "response", "residual", "deviation", "model_deviation",
                         "validation_residual", "cmif", "cmif_deviation"}) {
    EXPECT_TRUE(arrays.contains(id)) << id;
    EXPECT_FALSE(element(page, std::string("data-") + id).empty()) << id;
  }
  EXPECT_EQ(arrays.size(), 8u);
  EXPECT_EQ(count(page, "id=\"data-"), 8u);
}

TEST(Report, ShowsTheTotalVarianceOnlyWhereEnoughRealizationsTellIt) {
  ReportData data = small();
  for (const auto& [dof, kind] : {std::pair{1.0, "noise"},
                                  {3.0, "noise"},
                                  {4.0, "total"},
                                  {0.0, "total"}}) {  // 0: where it comes from is not known
    data.frf->total_dof = dof;
    EXPECT_EQ(content(report_page(data))["frf"]["deviation"], kind) << dof;
  }
  data.frf->total_dof = 1.0;
  data.frf->noise_variance.resize(0, 0);
  EXPECT_EQ(content(report_page(data))["frf"]["deviation"], "total");
}

TEST(Report, ShowsTheTotalVarianceWhereThereIsOneElseTheNoise) {
  ReportData data = small();
  EXPECT_EQ(content(report_page(data))["frf"]["deviation"], "total");
  data.frf->total_variance.resize(0, 0);
  const json noise = content(report_page(data));
  EXPECT_EQ(noise["frf"]["deviation"], "noise");
  // The synthetic noise variance is 0.9 of the total one.
  const double low = std::log2(data.frf->noise_variance.row(0).minCoeff()) / 2.0;
  EXPECT_NEAR(noise["arrays"]["deviation"]["low"][0].get<double>(), low, 1e-12);
  data.frf->noise_variance.resize(0, 0);
  EXPECT_FALSE(content(report_page(data))["arrays"].contains("deviation"));
}

TEST(Report, LeavesOutWhatIsAbsent) {
  ReportData data;
  data.title = "Nothing";
  const json empty = content(report_page(data));
  for (const char* part : {"frf", "model", "modes", "validation"})
    EXPECT_FALSE(empty.contains(part)) << part;
  EXPECT_TRUE(empty["arrays"].empty());

  data.frf = small().frf;
  const json measured = content(report_page(data));
  EXPECT_TRUE(measured.contains("frf"));
  EXPECT_FALSE(measured["arrays"].contains("residual"));
  EXPECT_FALSE(measured["arrays"].contains("cmif"));

  ReportData model;
  model.model = small().model;
  EXPECT_EQ(content(report_page(model))["modes"].size(), 3u);
}

TEST(Report, ShowsTheModelsCostHistory) {
  ReportData data = small();
  data.model->cost_history = {3.0, 2.0, 1.0};
  EXPECT_EQ(content(report_page(data))["cost"], json({3.0, 2.0, 1.0}));
}

TEST(Report, NoTextCanLeaveItsPlace) {
  const std::string attack = "</script><script>alert(1)</script><!--\"'&{{js}}";
  const ReportData plain = small();
  ReportData data = plain;
  data.title = data.frf->provenance_json = attack;
  data.frf->inputs.names[0] = data.frf->inputs.units[1] = attack;
  data.model->provenance_json = json({{"decisions", json::array({attack})}}).dump();
  data.documents = {{attack, attack}};
  data.figures = {{attack, attack}};
  data.steps = {{attack, 1.0, attack}};
  data.doubts = data.notes = {attack};
  data.runs[0].name = data.runs[0].started_utc = attack;
  data.model->fit.weighting = attack;
  data.frf->excluded_channels[0] = attack;
  const std::string page = report_page(data);
  EXPECT_EQ(count(page, "<script"), count(report_page(plain), "<script"));
  EXPECT_EQ(count(page, "</script"), count(report_page(plain), "</script"));
  EXPECT_EQ(count(page, "<!--"), 0u);
  EXPECT_EQ(count(page, "alert(1)</script>"), 0u);
  // And it arrives as it was.
  const json got = content(page);
  EXPECT_EQ(got["title"], attack);
  EXPECT_EQ(got["frf"]["inputs"][0]["name"], attack);
  EXPECT_EQ(got["frf"]["inputs"][1]["unit"], attack);
  EXPECT_EQ(got["decisions"][0], attack);
  EXPECT_EQ(got["documents"][0]["text"], attack);
  EXPECT_EQ(got["runs"][0]["name"], attack);
  EXPECT_EQ(got["frf"]["excluded"][0]["name"], attack);
}

TEST(Report, SurvivesTextThatIsNotUtf8AndNumbersThatAreNone) {
  ReportData data = small();
  data.frf->outputs.names[1] = "z\xff\xfe";
  data.validation->chi_square_per_dof = std::numeric_limits<double>::quiet_NaN();
  data.model->cost_history = {1.0, std::numeric_limits<double>::infinity()};
  const json got = content(report_page(data));
  EXPECT_EQ(got["frf"]["outputs"][1]["name"], "z\xEF\xBF\xBD\xEF\xBF\xBD");  // U+FFFD
  EXPECT_TRUE(got["validation"]["chi_square_per_dof"].is_null());
}

TEST(Report, NeedsNothingOutsideTheFile) {
  const std::string page = report_page(small());
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_EQ(count(page, "sourceMappingURL"), 0u);
  // Every place of the template is filled.
  EXPECT_THAT(page, testing::Not(testing::ContainsRegex("\\{\\{[a-z_]+\\}\\}")));
  // Nothing is loaded: no address in src or href but the empty icon's.
  const std::string head = page.substr(0, page.find("<style>"));
  EXPECT_THAT(head, testing::Not(testing::ContainsRegex(
                        R"re([[:space:]](src|href)[[:space:]]*=[[:space:]]*"([^"#d]|d[^a]))re")));
  EXPECT_EQ(count(head, "=\"da"), count(head, "=\"data:,\""));
  EXPECT_EQ(count(page, "<link"), 1u);
  EXPECT_EQ(count(page, "@import"), 0u);
  EXPECT_THAT(page, HasSubstr("Permission is hereby granted"));  // the library's licence
}

TEST(Report, IsTheSameBytesEveryTime) { EXPECT_EQ(report_page(small()), report_page(small())); }

/// The numbers of an array of a page, after packing: parts of complex ones count by themselves.
std::size_t numbers_in(const std::string& page, const std::string& id, std::size_t bytes_each) {
  return test::unpacked(element(page, "data-" + id)).size() / bytes_each;
}

TEST(Report, StaysBelowFourMegabytesAtFullSizeAndWithAnotherDayBelowFive) {
  ReportData data = test::synthetic_report({.variance_dof = 7});
  const std::string single = report_page(data);
  test::add_other_day(data);
  const std::string both = report_page(data);
  // Every number is there, and no array is left out because it is another's.
  constexpr std::size_t elements = 4 * 13 * 4000;
  for (const std::string& page : {single, both}) {
    EXPECT_EQ(numbers_in(page, "response", 8), elements);
    EXPECT_EQ(numbers_in(page, "residual", 5), elements);
    for (const char* id : {"deviation", "model_deviation", "validation_residual"})
      EXPECT_EQ(numbers_in(page, id, 1), elements) << id;
  }
  EXPECT_EQ(numbers_in(both, "other_response", 5), elements);
  EXPECT_EQ(numbers_in(both, "other_model", 5), elements);
  EXPECT_LT(single.size(), 4'000'000u);
  EXPECT_LT(both.size(), 4'800'000u);
  // The noise is its own: 16 bits of each part of the residual cannot become less.
  EXPECT_GT(element(single, "data-residual").size(), elements * 4 * 9 / 10 * 4 / 3);
  EXPECT_GT(element(both, "data-other_response").size(), elements * 2);
}

TEST(Report, StaysBelowFiveMegabytesWhereNothingIsButNoise) {
  ReportData data = test::synthetic_report({.relative_noise = 3.0, .variance_dof = 7});
  test::add_other_day(data);
  EXPECT_LT(report_page(data).size(), 5'000'000u);
}

TEST(Report, RefusesShapesThatDoNotAgree) {
  EXPECT_THAT(refusal([](ReportData& d) { d.model_response.conservativeResize(5, 50); }),
              HasSubstr("model_response: got 5 x 50; expected 6 x 50"));
  EXPECT_THAT(refusal([](ReportData& d) { d.model_variance.conservativeResize(6, 49); }),
              HasSubstr("model_variance: got 6 x 49"));
  EXPECT_THAT(refusal([](ReportData& d) { d.model_variance(1, 1) = -1.0; }),
              HasSubstr("model_variance: negative"));
  EXPECT_THAT(refusal([](ReportData& d) { d.model_response(0, 0) = std::nan(""); }),
              HasSubstr("model_response: contains values that are not finite"));
  EXPECT_THAT(refusal([](ReportData& d) { d.validation_frf->frequency_hz[3] += 1e-3; }),
              HasSubstr("validation_frf: its lines"));
  EXPECT_THAT(refusal([](ReportData& d) { d.frf.reset(); }),
              HasSubstr("the held-back response needs the fitted one"));
  EXPECT_EQ(refusal([](ReportData&) {}), "no error");
}

TEST(Report, IsWrittenWholeOrNotAtAll) {
  const std::filesystem::path directory =
      std::filesystem::path(testing::TempDir()) / "stageid_report_page_test";
  std::filesystem::remove_all(directory);
  std::filesystem::create_directories(directory);
  const std::filesystem::path file = directory / "report.html";
  write_report(file, small());
  EXPECT_EQ(read_whole_file(file), report_page(small()));

  ReportData wrong = small();
  wrong.model_response.resize(1, 1);
  wrong.model_response(0, 0) = 0.0;
  EXPECT_THROW(write_report(directory / "wrong.html", wrong), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(directory / "wrong.html"));
  EXPECT_THROW(write_report(directory / "missing" / "report.html", small()), FileError);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory), {}), 1);
  std::filesystem::remove_all(directory);
}

}  // namespace stageid::test_report_page
