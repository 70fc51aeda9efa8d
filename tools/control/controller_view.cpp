#include "tools/control/controller_view.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/output_file.hpp"
#include "estimation/file/json_file.hpp"
#include "tools/control/stage_loop.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

Json margin_json(const Margin& margin) {
  return {{"value", margin.value},
          {"radius_95", or_null(margin.radius_95())},
          {"frequency_hz", margin.frequency_hz},
          {"frequency_std_hz", or_null(margin.frequency_deviation_hz)},
          {"extrapolated", margin.extrapolated}};
}

Json margin_json(const std::optional<Margin>& margin) {
  return margin ? margin_json(*margin) : Json();
}

void add_margins(const LoopMargins& margins, Json& loop) {
  loop["gain_margin_db"] = margin_json(margins.gain_db);
  loop["gain_reduction_db"] = margin_json(margins.gain_reduction_db);
  loop["phase_margin_deg"] = margin_json(margins.phase_deg);
  loop["delay_margin_s"] = margin_json(margins.delay_s);
  loop["modulus_margin"] = margin_json(margins.modulus);
}

void add_curve(const Eigen::VectorXcd& curve, const Eigen::VectorXd& radius, Json& out) {
  out["re"] = Eigen::VectorXd(curve.real());
  out["im"] = Eigen::VectorXd(curve.imag());
  if (radius.size() > 0) out["radius_95"] = radius;
}

/// Radii of one curve; empty: unknown.
Eigen::VectorXd radius_of(const LoopView& view, Eigen::Index loop) {
  return view.loop_radius.size() > 0 ? Eigen::VectorXd(view.loop_radius.row(loop).transpose())
                                     : Eigen::VectorXd();
}

std::string margin_text(const Margin& margin, double scale, const char* unit) {
  const std::optional<double> radius = margin.radius_95();
  return fmt::format("{:.4g}{}{} at {:.4g} Hz{}", scale * margin.value,
                     radius ? fmt::format(" +- {:.2g}", scale * *radius) : "", unit,
                     margin.frequency_hz, margin.extrapolated ? " (outside the fitted band)" : "");
}

std::string margin_text(const std::optional<Margin>& margin, double scale, const char* unit) {
  return margin ? margin_text(*margin, scale, unit) : "none";
}

}  // namespace

ControllerView controller_view(const StageConfig& stage, const AdditiveModel& model,
                               const Eigen::MatrixXd& covariance,
                               const Eigen::VectorXd& frequency_hz) {
  try {
    const LoopController controller = stage_loop(stage.spec, model);
    return {controller.loops, model.sample_rate_hz, "",
            loop_view(model, controller, covariance, frequency_hz)};
  } catch (const std::invalid_argument& problem) {
    throw std::invalid_argument(named(stage.file, problem.what()));
  }
}

Json controller_view_json(const ControllerView& of, bool curves) {
  const LoopView& view = of.view;
  Json out = {{"format", "stageid-controller-view"},
              {"format_version", 1},
              {"sample_rate_hz", of.sample_rate_hz},
              {"model_fingerprint", of.model_fingerprint},
              {"stable", view.poles.stable()},
              {"largest_pole", view.poles.largest_pole},
              {"largest_pole_hz", view.poles.pole_hz},
              {"unstable_poles",
               {{"closed_loop", view.poles.unstable_closed_loop},
                {"open_loop", view.poles.unstable_open_loop}}},
              {"encirclements", view.poles.encirclements()}};
  Json determinant = {{"distance", view.margins ? margin_json(view.margins->distance) : Json()}};
  if (curves) {
    out["frequency_hz"] = view.frequency_hz;
    add_curve(view.determinant, view.determinant_radius, determinant);
  }
  out["determinant"] = std::move(determinant);
  out["loops"] = Json::array();
  for (std::size_t k = 0; k < of.loops.size(); ++k) {
    Json loop = {{"name", of.loops[k]}};
    if (view.margins) add_margins(view.margins->loops[k], loop);
    if (curves) add_curve(view.loop.row(k).transpose(), radius_of(view, k), loop);
    out["loops"].push_back(std::move(loop));
  }
  return out;
}

std::string controller_view_csv(const ControllerView& of) {
  const LoopView& view = of.view;
  const Eigen::Index N = view.frequency_hz.size();
  std::vector<std::string> names = of.loops;
  names.emplace_back("det(I + L)");
  std::string text = "frequency_hz";
  for (const std::string& name : names)
    for (const char* part : {"real", "imaginary", "radius_95"})
      text += fmt::format(",{}", csv_field(fmt::format("{} {}", part, name)));
  text += "\n";
  for (Eigen::Index k = 0; k < N; ++k) {
    text += fmt::format("{}", view.frequency_hz[k]);
    const auto add = [&](std::complex<double> value, double radius) {
      text += fmt::format(",{},{},{}", value.real(), value.imag(),
                          std::isfinite(radius) ? fmt::format("{}", radius) : "");
    };
    const bool known = view.loop_radius.size() > 0;
    for (Eigen::Index i = 0; i < view.loop.rows(); ++i)
      add(view.loop(i, k), known ? view.loop_radius(i, k) : std::nan(""));
    add(view.determinant[k], known ? view.determinant_radius[k] : std::nan(""));
    text += "\n";
  }
  return text;
}

std::vector<std::string> controller_view_lines(const ControllerView& of) {
  const LoopPoles& poles = of.view.poles;
  std::vector<std::string> out = {fmt::format(
      "closed loop: {}; outermost pole |z| = {:.6g} at {:.4g} Hz; det(I + L) encircles 0 {} times, "
      "{} open-loop poles are unstable",
      poles.stable() ? "stable" : "unstable", poles.largest_pole, poles.pole_hz,
      poles.encirclements(), poles.unstable_open_loop)};
  if (!of.view.margins) return out;
  for (std::size_t k = 0; k < of.loops.size(); ++k) {
    const LoopMargins& m = of.view.margins->loops[k];
    out.push_back(fmt::format(
        "loop {}: gain margin {}, gain reduction {}, phase margin {}, delay margin {}, modulus "
        "margin {}",
        of.loops[k], margin_text(m.gain_db, 1.0, " dB"),
        margin_text(m.gain_reduction_db, 1.0, " dB"), margin_text(m.phase_deg, 1.0, " deg"),
        margin_text(m.delay_s, 1e3, " ms"), margin_text(m.modulus, 1.0, "")));
  }
  out.push_back(
      fmt::format("least |det(I + L)|: {}", margin_text(of.view.margins->distance, 1.0, "")));
  return out;
}

std::string read_controller_view(const std::filesystem::path& path,
                                 const std::filesystem::path& model) {
  const JsonFile file(path, "stageid-controller-view");
  const JsonNode root = file.root();
  const std::string fingerprint = root.text_or_empty("model_fingerprint");
  if (!model.empty() && !fingerprint.empty() && fingerprint != fingerprint_of_file(model))
    root.member("model_fingerprint")
        .fail(fmt::format("is that of another model than {}; write the view again with 'stageid "
                          "export --controller-view'",
                          model.string()));
  const std::size_t lines = root.member("frequency_hz").numbers().size();
  const auto check_curve = [&](const JsonNode& curve) {
    std::vector<JsonNode> parts = {curve.member("re"), curve.member("im")};
    if (curve.has("radius_95")) parts.push_back(curve.member("radius_95"));
    for (const JsonNode& part : parts)
      if (part.numbers_or_null().size() != lines)
        part.fail(fmt::format("needs {} numbers, one per frequency", lines));
  };
  check_curve(root.member("determinant"));
  for (const JsonNode& loop : root.elements_of("loops")) {
    static_cast<void>(loop.member("name").text());
    check_curve(loop);
  }
  return root.raw().dump();
}

void write_controller_view(const std::filesystem::path& file, const ControllerView& view) {
  write_text_file(file, file.extension() == ".csv"
                            ? controller_view_csv(view)
                            : controller_view_json(view, true).dump() + "\n");
}

}  // namespace stageid
