#include "tools/report/report_page.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "acquisition/files/output_file.hpp"
#include "tools/report/html_page.hpp"
#include "tools/report/report_json.hpp"

namespace stageid {
namespace {

template <typename Matrix>
void check_shape(const char* name, const Matrix& matrix, Eigen::Index rows, Eigen::Index columns) {
  if (matrix.size() == 0) return;
  if (matrix.rows() != rows || matrix.cols() != columns)
    throw std::invalid_argument(fmt::format("{}: got {} x {}; expected {} x {}, as the response",
                                            name, matrix.rows(), matrix.cols(), rows, columns));
  if (!matrix.allFinite())
    throw std::invalid_argument(fmt::format("{}: contains values that are not finite", name));
}

void check_variance(const char* name, const Eigen::MatrixXd& variance, Eigen::Index rows,
                    Eigen::Index columns) {
  check_shape(name, variance, rows, columns);
  if (variance.size() > 0 && variance.minCoeff() < 0.0)
    throw std::invalid_argument(fmt::format("{}: negative", name));
}

void check_data(const ReportData& data) {
  if (!data.frf) {
    const bool other = data.comparison && (data.comparison->response.size() > 0 ||
                                           data.comparison->model_response.size() > 0);
    if (data.nonlinearity || data.model_response.size() > 0 || data.cmif_curves.size() > 0 ||
        data.validation_frf || other)
      throw std::invalid_argument(
          "report: model_response, cmif_curves, validation_frf, nonlinearity and the responses of "
          "a comparison need an frf with the same lines");
    return;
  }
  const FrfEstimate& frf = *data.frf;
  check(frf);
  const Eigen::Index channels = frf.n_outputs() * frf.n_inputs();
  check_shape("model_response", data.model_response, channels, frf.lines());
  check_variance("model_variance", data.model_variance, channels, frf.lines());
  check_variance("cmif_curves", data.cmif_curves, std::min(frf.n_outputs(), frf.n_inputs()),
                 frf.lines());
  if (data.comparison) {
    check_shape("comparison.response", data.comparison->response, channels, frf.lines());
    check_shape("comparison.model_response", data.comparison->model_response, channels,
                frf.lines());
  }
  if (data.nonlinearity) {
    const Eigen::Index bands = data.nonlinearity->band_hz.rows();
    check_shape("nonlinearity.p_value", data.nonlinearity->p_value, channels, bands);
    check_shape("nonlinearity.distortion", data.nonlinearity->distortion, channels, bands);
  }
  if (data.validation) {
    const Eigen::VectorXd& error =
        data.validation->channel_error;  // NaN: the channel does not respond
    check_shape("validation.channel_error",
                error.array().isNaN().select(0.0, error).matrix().eval(), channels, 1);
  }
  if (!data.validation_frf) return;
  check(*data.validation_frf);
  check_shape("validation_frf", data.validation_frf->response, channels, frf.lines());
  if (data.validation_frf->frequency_hz != frf.frequency_hz)
    throw std::invalid_argument("validation_frf: its lines differ from those of frf");
}

std::string block_elements(const std::vector<report::Block>& blocks) {
  std::string out;
  for (const report::Block& block : blocks)
    out += fmt::format("<script type=\"text/plain\" id=\"data-{}\">{}</script>\n", block.id,
                       block.base64);
  return out;
}

}  // namespace

std::string report_page(const ReportData& data) {
  check_data(data);
  const report::PageContent content = report::page_content(data);
  return html_page(HtmlPage::report, data.title, content.json, block_elements(content.blocks));
}

void write_report(const std::filesystem::path& file, const ReportData& data) {
  write_text_file(file, report_page(data));
}

}  // namespace stageid
