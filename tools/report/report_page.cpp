#include "tools/report/report_page.hpp"

#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "tools/report/html_page.hpp"
#include "tools/report/report_json.hpp"

namespace stageid {
namespace {

template <typename Matrix>
void check_shape(const char* name, const Matrix& matrix, Eigen::Index rows, Eigen::Index columns) {
  if (matrix.size() == 0) return;
  if (matrix.rows() != rows || matrix.cols() != columns)
    fail_request("{}: got {} x {}; expected {} x {}, as the response", name, matrix.rows(),
                 matrix.cols(), rows, columns);
  if (!matrix.allFinite()) fail_request("{}: contains values that are not finite", name);
}

/// Each file was checked when it was read; here, those that do not belong together are refused.
void check_data(const ReportData& data) {
  if (!data.frf) {
    if (data.validation_frf)
      fail_request("report: the held-back response needs the fitted one; add its file");
    return;
  }
  const FrfEstimate& frf = *data.frf;
  const Eigen::Index channels = frf.n_outputs() * frf.n_inputs();
  check_shape("model_response", data.model_response, channels, frf.lines());
  check_shape("model_variance", data.model_variance, channels, frf.lines());
  if (data.model_variance.size() > 0 && data.model_variance.minCoeff() < 0.0)
    fail_request("model_variance: negative");
  if (data.comparison)
    check_shape("comparison.model_response", data.comparison->model_response, channels,
                frf.lines());
  if (!data.validation_frf) return;
  check_shape("validation_frf", data.validation_frf->response, channels, frf.lines());
  if (data.validation_frf->frequency_hz != frf.frequency_hz)
    fail_request("validation_frf: its lines differ from those of frf");
}

}  // namespace

std::string report_page(const ReportData& data) {
  check_data(data);
  const report::PageContent content = report::page_content(data);
  return html_page(HtmlPage::report, data.title, content.json, content.blocks);
}

void write_report(const std::filesystem::path& file, const ReportData& data) {
  write_text_file(file, report_page(data));
}

}  // namespace stageid
