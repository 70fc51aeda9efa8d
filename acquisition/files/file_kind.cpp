#include "acquisition/files/file_kind.hpp"

#include <fmt/format.h>

#include <array>
#include <fstream>
#include <regex>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_file.hpp"

namespace stageid {
namespace {

struct FileKind {
  std::string_view mark;  ///< first bytes of the file, or the value of its key `format`
  std::string_view name;
  std::string_view taken_by;
};

constexpr std::string_view kTakesLogs = "use it with 'stageid frf', 'validate', 'report' or 'log'";
constexpr std::string_view kTakesConfigurations =
    "use it with 'stageid identify', 'design', 'run' or 'config check'";

/// By the key `format` of stageid's files.
constexpr std::array kOurs = {
    FileKind{"stageid-log.h5", "a log in HDF5", kTakesLogs},
    FileKind{"stageid-frf.h5", "a frequency response",
             "use it with 'stageid modes', 'fit', 'validate', 'export', 'report' or 'plot'"},
    FileKind{"stageid-excitation.h5", "a designed excitation",
             "use it with 'stageid run --excitation'"},
    FileKind{"stageid-model.h5", "an exported model, for other programs",
             "give its model.json to 'stageid report' as well"},
    FileKind{"stageid-model", "a model",
             "use a model.json with 'stageid validate', 'export', 'report' or 'plot'"},
    FileKind{"stageid-modes", "a list of modes",
             "use it with 'stageid fit --modes', 'report' or 'plot'"},
    FileKind{"stageid-summary", "a summary of 'stageid identify'", "use it with 'stageid report'"},
    FileKind{"stageid-experiment", "an experiment file", kTakesConfigurations},
    FileKind{"stageid-stage", "a stage file", "use it with 'stageid config check' or 'node'"}};

constexpr std::string_view kHdf5Head = "\x89HDF\r\n\x1a\n";

/// By the first bytes.
constexpr std::array kByHead = {
    FileKind{"\x89SLOG", "a native log", kTakesLogs},
    FileKind{kHdf5Head, "an HDF5 file of another program", "convert it with 'stageid import'"},
    FileKind{"MATLAB", "a MATLAB file", "convert it with 'stageid import'"},
    FileKind{"PK\x03\x04", "a ZIP archive (possibly .npz)",
             "convert .npz files with 'stageid import'"},
    FileKind{"    -1\n", "a universal file", "convert it with 'stageid import'"},
    FileKind{"    -1\r\n", "a universal file", "convert it with 'stageid import'"},
    FileKind{"<!DOCTYPE html", "an HTML page", "open it in a browser"},
    FileKind{"{", "JSON", "a model or a list of modes has the key \"format\""}};

std::string sentence(const FileKind& kind, const std::string& wanted) {
  return std::string("is ").append(kind.name) + ", not " + wanted + "; " +
         std::string(kind.taken_by);
}

std::string sentence_of_format(const std::string& format, const std::string& wanted) {
  for (const FileKind& kind : kOurs)
    if (format == kind.mark) return sentence(kind, wanted);
  return "";
}

/// Value of the key `format` in JSON or YAML, or of the attribute of an HDF5 file with .h5 appended; empty if
/// there is none.
std::string named_format(const std::filesystem::path& file, const std::string& head) {
  if (is_hdf5_head(head)) {
    try {
      const Hdf5File hdf5 = Hdf5File::open(file);
      return hdf5.has_attribute("/", "format")
                 ? hdf5.read_text_attribute("/", "format").append(".h5")
                 : "";
    } catch (const FormatError&) {
      return "";  // damaged: use its first bytes
    }
  }
  static const std::regex text(R"re((?:^|\n)[ \t{"]*format"?[ \t]*:[ \t]*"?(stageid-[a-z]+))re");
  std::smatch found;
  return std::regex_search(head, found, text) ? found[1].str() : "";
}

std::string head_of(const std::filesystem::path& file, std::size_t bytes) {
  std::string head(bytes, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(stream.gcount());
  return head;
}

}  // namespace

bool is_hdf5(const std::filesystem::path& file) {
  return is_hdf5_head(head_of(file, kHdf5Head.size()));
}

bool is_hdf5_head(std::string_view head) noexcept { return head.starts_with(kHdf5Head); }

std::string other_kind(const std::filesystem::path& file, const std::string& wanted) {
  const std::string head = head_of(file, 2048);
  const std::string format = named_format(file, head);
  if (std::string ours = sentence_of_format(format, wanted); !ours.empty()) return ours;
  for (const FileKind& kind : kByHead)
    if (head.starts_with(kind.mark)) return sentence(kind, wanted);
  return "";
}

std::string other_hdf5_kind(const std::string& format, const std::string& wanted) {
  return sentence_of_format(format + ".h5", wanted);
}

void require_format(const Hdf5File& file, const std::string& format, const std::string& wanted,
                    const std::string& hint) {
  if (!file.has_attribute("/", "format"))
    fail_format(file.path(), "/", "attribute format is missing; expected '{}'", format);
  const std::string found = file.read_text_attribute("/", "format");
  if (found == format) return;
  const std::string other = other_hdf5_kind(found, wanted);
  throw FormatError(
      file.path(), "/",
      !other.empty() ? other : fmt::format("format is '{}'; expected '{}'{}", found, format, hint));
}

void require_version(const Hdf5File& file, long long version) {
  const long long found = file.read_integer_attribute("/", "format_version");
  if (found != version)
    fail_format(file.path(), "/", "unsupported format_version {}; this program reads {}", found,
                version);
}

}  // namespace stageid
