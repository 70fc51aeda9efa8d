#include "acquisition/files/input_files.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "acquisition/files/file_descriptor.hpp"
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
  const FileDescriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!descriptor || ::fstat(descriptor.get(), &status) != 0)
    fail("cannot be read: " + system_reason(errno));
  if (S_ISDIR(status.st_mode)) fail("is a directory; give the name of a file");
  if (!S_ISREG(status.st_mode) && !S_ISFIFO(status.st_mode))
    fail("is not a regular file; give the name of a file");
  std::string text;
  if (!read_to_end(descriptor, text)) fail("cannot be read: " + system_reason(errno));
  return text;
}

}  // namespace stageid
