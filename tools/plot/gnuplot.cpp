#include "tools/plot/gnuplot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <sstream>
#include <string_view>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "tools/terminal/external_program.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

constexpr double kPngDotsPerInch = 300.0;
constexpr double kSvgUnitsPerInch = 96.0;
constexpr double kPointsPerInch = 72.0;

/// A terminal of gnuplot, with sizes such that all formats look alike. Cairo does not report a full disk, so a picture
/// is checked for its last bytes.
struct Format {
  const char* ending;
  const char* terminal;
  const char* unit;
  double per_inch;
  double line, point;  ///< of the width of a line, of a length: units per point
  double font;  ///< Cairo interprets a point of a font as 1/96 inch, readers of SVG as a point
  std::string_view last;
};
constexpr double kCairoFont = kPointsPerInch / kSvgUnitsPerInch;
constexpr Format kFormats[] = {  // in the order of PictureFormat
    {".pdf", "pdfcairo rounded", "in", 1.0, 2.0, 1.0, kCairoFont, "%%EOF\n"},
    {".svg", "svg", "", kSvgUnitsPerInch, kSvgUnitsPerInch / kPointsPerInch,
     kSvgUnitsPerInch / kPointsPerInch, 1.0, "</svg>\n"},
    {".png", "pngcairo rounded", "", kPngDotsPerInch, kPngDotsPerInch / kPointsPerInch,
     kPngDotsPerInch / kPointsPerInch, kCairoFont, "IEND\xae\x42\x60\x82"}};

/// A directory that only this user can read, removed with its content at the end.
class PrivateDirectory {
 public:
  PrivateDirectory() {
    std::string name = (std::filesystem::temp_directory_path() / "stageid-plot-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr)
      fail_file(name, "cannot be created: {}; set TMPDIR to a directory with free space",
                std::strerror(errno));
    path_ = name;
  }
  ~PrivateDirectory() { remove(); }
  void remove() const {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  PrivateDirectory(PrivateDirectory&&) = delete;
  const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

/// Names of files are our own and relative: external texts are in the script only through quoted().
std::string preamble(const Picture& picture, const Format& format) {
  return fmt::format(
      "set encoding utf8\nset terminal {} enhanced size {}{},{}{} font '{},{:.4g}' "
      "fontscale {:.6g} linewidth {:.6g} dashlength {:.6g}\npoint = {:.6g}\n"
      "set output 'picture'\n",
      format.terminal, picture.width_in * format.per_inch, format.unit,
      picture.height_in * format.per_inch, format.unit, picture.style.font, picture.style.font_pt,
      format.point * format.font, format.line, 2.0 * format.point, format.point);
}

/// With grey of the same brightness (ITU-R BT.601) for every colour. Texts of others contain no '#rrggbb' in quotes of
/// its own: their quotes are doubled.
std::string greyed(const std::string& script) {
  static constexpr std::string_view kColour = "rgb '#";
  std::string out = script;
  for (std::size_t at = out.find(kColour); at != std::string::npos;
       at = out.find(kColour, at + 1)) {
    const std::size_t digits = at + kColour.size();
    const auto part = [&](std::size_t i) {
      return static_cast<double>(std::stoi(out.substr(digits + 2 * i, 2), nullptr, 16));
    };
    const auto grey = static_cast<int>(0.299 * part(0) + 0.587 * part(1) + 0.114 * part(2) + 0.5);
    out.replace(digits, 6, fmt::format("{0:02x}{0:02x}{0:02x}", grey));
  }
  return out;
}

/// The first line that is neither empty nor a position in the script.
std::string first_message(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    line.erase(0, line.find_first_not_of(" \t^"));
    if (line.starts_with("\"script.gp\"")) return line;
  }
  return text.empty() ? "no message" : text.substr(0, text.find('\n'));
}

bool is_whole(std::string_view bytes, const Format& format) {
  while (bytes.ends_with("\n\n")) bytes.remove_suffix(1);  // of SVG
  return bytes.ends_with(format.last);
}

/// Sets the creation time of a PDF to 1970, so that equal requests give equal bytes.
void forget_date(std::string& pdf) {
  static constexpr std::string_view kKey = "/CreationDate (D:";
  static constexpr std::string_view kDate = "19700101000000";
  const std::size_t at = pdf.rfind(kKey);
  if (at == std::string::npos || at + kKey.size() + kDate.size() > pdf.size()) return;
  pdf.replace(at + kKey.size(), kDate.size(), kDate);
}

}  // namespace

PictureFormat picture_format(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  const Format* const format = std::ranges::find(kFormats, ending, &Format::ending);
  if (format == std::end(kFormats))
    fail_request("{}: unsupported picture format '{}'; use .pdf, .svg or .png", file.string(),
                 ending);
  return static_cast<PictureFormat>(format - kFormats);
}

void draw(const Picture& picture, const std::filesystem::path& file) {
  const PictureFormat kind = picture_format(file);
  const Format& format = kFormats[static_cast<std::size_t>(kind)];
  const PrivateDirectory directory;
  const CleanedUpAtInterrupt clean_up([&directory] {
    kill_external();
    directory.remove();
  });
  for (const Picture::Table& table : picture.tables)
    write_text_file(directory.path() / table.name, table.text);
  write_text_file(directory.path() / "script.gp",
                  preamble(picture, format) +
                      (picture.style.grey ? greyed(picture.script) : picture.script) +
                      "unset output\n");
  const ExternalEnd end =
      run_external({"TZ=UTC", "gnuplot", "-d", "script.gp"}, directory.path(), "gnuplot-nox");
  throw_if_interrupted();
  const std::filesystem::path picture_file = directory.path() / "picture";
  std::string bytes =
      std::filesystem::exists(picture_file) ? read_whole_file(picture_file) : std::string();
  if (end.status != 0 || !is_whole(bytes, format))
    fail_file(file, "gnuplot failed: {}; check the free space in {}", first_message(end.messages),
              std::filesystem::temp_directory_path().string());
  if (kind == PictureFormat::pdf) forget_date(bytes);
  write_text_file(file, bytes);
}

}  // namespace stageid
