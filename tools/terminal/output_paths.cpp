#include "tools/terminal/output_paths.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {

void require_no_input(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& inputs) {
  for (const std::filesystem::path& input : inputs) {
    std::error_code none;  // if one of them does not exist, they are not the same
    if (std::filesystem::equivalent(file, input, none))
      fail_request("{}: is an input file and would be overwritten; choose another name with -o",
                   file.string());
  }
}

void require_writable(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& inputs) {
  require_no_input(file, inputs);
  const OutputFile probe(file);
}

std::string named(const std::filesystem::path& file, const std::string& message) {
  const std::string place = file.string() + ": ";
  return message.starts_with(place) ? message : place + message;
}

void require_readable(const std::filesystem::path& file) {
  note_input(file);
  errno = 0;
  if (!std::ifstream(file, std::ios::binary) || std::filesystem::is_directory(file))
    fail_file(file, "cannot be read: {}", system_reason(errno != 0 ? errno : EISDIR));
}

void require_ending(const std::filesystem::path& file, const std::string& what,
                    const std::vector<std::string>& endings) {
  if (std::ranges::find(endings, file.extension().string()) != endings.end()) return;
  fail_request("{}: {} is written as {}; use a name with that ending", file.string(), what,
               fmt::join(endings, ", "));
}

void require_model_ending(const std::filesystem::path& file) {
  require_ending(file, "a model", {".json"});
}

void require_frf_ending(const std::filesystem::path& file) {
  require_ending(file, "a frequency response", {".h5", ".hdf5"});
}

void require_directory(const std::filesystem::path& directory, const std::string& remedy) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || !std::filesystem::is_directory(directory))
    fail_file(directory, "cannot create the directory: {}; {}",
              error ? error.message() : "a file of that name exists", remedy);
}

}  // namespace stageid
