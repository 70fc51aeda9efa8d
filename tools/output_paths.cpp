#include "tools/output_paths.hpp"

#include <fmt/format.h>

#include <system_error>

#include "excitation/file_error.hpp"
#include "excitation/output_file.hpp"

namespace stageid {

void require_writable(const std::filesystem::path& file) { const OutputFile probe(file); }

void require_directory(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || !std::filesystem::is_directory(directory))
    throw FileError(fmt::format("{}: cannot be made a directory: {}; give another -o",
                                directory.string(),
                                error ? error.message() : "a file stands there"));
}

}  // namespace stageid
