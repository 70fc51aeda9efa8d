#pragma once

#include <filesystem>

#include "tools/plot/picture.hpp"

namespace stageid {

/// Given by the extension of the file.
enum class PictureFormat : std::uint8_t { pdf, svg, png };

/// @throws std::invalid_argument naming the file and the supported extensions.
PictureFormat picture_format(const std::filesystem::path& file);

/// Draws the picture with gnuplot in a private temporary directory and writes the file atomically. Equal pictures give
/// equal bytes on one machine. PNG at 300 dots per inch.
/// @throws std::invalid_argument as picture_format(); FileError if gnuplot is not installed or fails, or a file
///         cannot be written; Interrupted
void draw(const Picture& picture, const std::filesystem::path& file);

}  // namespace stageid
