#include "acquisition/files/input_files.hpp"

#include <sys/stat.h>

#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

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

}  // namespace stageid
