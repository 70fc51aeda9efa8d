#include "acquisition/formats/open_log.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/formats/hdf5_log.hpp"
#include "acquisition/slog/slog_reader.hpp"

namespace stageid {

std::unique_ptr<LogReader> open_log(const std::filesystem::path& file, bool damaged_is_error) {
  std::array<char, kSlogMagic.size()> head{};
  {
    const SlogSource source(file);
    if (source.bytes() == 0)
      throw FormatError(file, "", "is empty; give a native log (.slog) or an HDF5 log");
    source.read(0, head.data(), std::min<std::uint64_t>(head.size(), source.bytes()));
  }
  if (std::memcmp(head.data(), kSlogMagic.data(), head.size()) == 0)
    return std::make_unique<SlogReader>(file, damaged_is_error);
  if (is_hdf5_head({head.data(), head.size()})) return std::make_unique<Hdf5LogReader>(file);
  // A native log whose first block is damaged may have intact blocks.
  if (!damaged_is_error) return std::make_unique<SlogReader>(file, false);
  if (const std::string other = other_kind(file, "a log"); !other.empty())
    throw FormatError(file, "", other);
  throw FormatError(
      file, "",
      "is neither a native log (.slog) nor an HDF5 file. Convert files of other programs with "
      "'stageid import'; repair a damaged native log with 'stageid log recover'");
}

}  // namespace stageid
