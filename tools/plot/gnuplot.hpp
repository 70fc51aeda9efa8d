#pragma once

#include <filesystem>

#include "tools/plot/picture.hpp"

namespace stageid {

/// By the file's ending.
enum class PictureFormat : std::uint8_t { pdf, svg, png };

/// @throws std::invalid_argument naming the file and the endings there are.
PictureFormat picture_format(const std::filesystem::path& file);

/// Has gnuplot draw the picture, in a private temporary directory, and writes the file, whole or not at all; the
/// same picture gives the same bytes on one machine. PNG at 300 dots per inch.
/// @throws std::invalid_argument as picture_format(); FileError if gnuplot is not installed or fails, or a file
///         cannot be written; Interrupted
void draw(const Picture& picture, const std::filesystem::path& file);

}  // namespace stageid
