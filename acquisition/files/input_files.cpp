#include "acquisition/files/input_files.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

using Identity = std::pair<dev_t, ino_t>;

struct NotedFiles {
  std::mutex mutex;
  std::set<Identity> inputs, outputs, own;
  bool are_protected = false;
};

NotedFiles& noted() {
  static auto* const shared = new NotedFiles;  // outputs may end during the destruction of others
  return *shared;
}

/// Nothing if the file does not exist or is not protected.
std::optional<Identity> identity_of(const std::filesystem::path& file) {
  struct stat status {};
  if (!noted().are_protected || ::stat(file.c_str(), &status) != 0) return std::nullopt;
  return Identity(status.st_dev, status.st_ino);
}

void note(const std::filesystem::path& file, std::set<Identity>& use,
          const std::set<Identity>& refused) {
  const std::lock_guard lock(noted().mutex);
  const std::optional<Identity> identity = identity_of(file);
  if (!identity || noted().own.contains(*identity)) return;
  if (refused.contains(*identity))
    throw std::invalid_argument(
        file.string() + ": is an input file and would be overwritten; choose another name with -o");
  use.insert(*identity);
}

}  // namespace

void protect_inputs() {
  const std::lock_guard lock(noted().mutex);
  noted().are_protected = true;
}

void note_input(const std::filesystem::path& file) { note(file, noted().inputs, noted().outputs); }

void note_output(const std::filesystem::path& file) { note(file, noted().outputs, noted().inputs); }

void note_own_file(const std::filesystem::path& file) { note(file, noted().own, noted().inputs); }

std::string read_whole_file(const std::filesystem::path& file) {
  note_input(file);
  const auto fail = [&file](const std::string& what) {
    throw FileError(file.string() + ": " + what);
  };
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail("cannot be read: " + system_reason(errno));
  struct Close {
    int descriptor;
    ~Close() { ::close(descriptor); }
  } const closed_at_the_end{descriptor};
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) fail("cannot be read: " + system_reason(errno));
  if (S_ISDIR(status.st_mode)) fail("is a directory; give the name of a file");
  if (!S_ISREG(status.st_mode) && !S_ISFIFO(status.st_mode))
    fail("is not a regular file; give the name of a file");
  std::string text;
  std::string piece(std::size_t{1} << 18, '\0');
  while (true) {
    const ssize_t got = ::read(descriptor, piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail("cannot be read: " + system_reason(errno));
    if (got == 0) return text;
    text.append(piece, 0, static_cast<std::size_t>(got));
  }
}

}  // namespace stageid
