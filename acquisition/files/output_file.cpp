#include "acquisition/files/output_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <regex>
#include <set>
#include <string>
#include <system_error>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

/// Temporary files of unfinished outputs.
struct UnfinishedFiles {
  std::mutex mutex;
  std::set<std::filesystem::path> files;
};

/// Never destroyed: an interrupt may occur during the destruction of static objects.
UnfinishedFiles& unfinished() {
  static auto* const shared = new UnfinishedFiles;
  return *shared;
}

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what, int error,
                       const std::string& remedy = "") {
  fail_file(
      shown_name(file), "{}: {}", what,
      remedy.empty() ? system_reason(error) : fmt::format("{}; {}", std::strerror(error), remedy));
}

std::filesystem::path directory_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

/// The file to be replaced: the target of a symbolic link, not the link. Devices and directories are refused,
/// because rename() would replace /dev/null by a file.
std::filesystem::path resolve_target(const std::filesystem::path& target) {
  // weakly_canonical() does not follow a link to a file that does not exist yet.
  constexpr int kMaxLinks = 40;  // the kernel's own limit
  std::error_code ignored;
  std::filesystem::path resolved = target;
  for (int links = 0; std::filesystem::is_symlink(resolved, ignored); ++links) {
    if (links == kMaxLinks) fail(target, "cannot follow the symbolic link", ELOOP);
    std::error_code error;
    resolved = resolved.parent_path() / std::filesystem::read_symlink(resolved, error);
    if (error) fail(target, "cannot follow the symbolic link", error.value());
  }
  const std::filesystem::file_status status = std::filesystem::status(resolved, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    fail_file(target, "is {}; give the name of a file to write",
              std::filesystem::is_directory(status) ? "a directory" : "not a regular file");
  if (!resolved.has_filename())
    throw FileError("'" + target.string() +
                    "': is not a file name; give the name of a file to write");
  return resolved;
}

/// A hidden name in the target's directory, so that rename() stays within one file system.
std::filesystem::path temporary_beside(const std::filesystem::path& target) {
  static std::atomic<unsigned> count = 0;  // several outputs of one process may share a target
  return directory_of(target) / fmt::format(".{}.{}.{}.tmp", target.filename().string(), ::getpid(),
                                            count.fetch_add(1, std::memory_order_relaxed));
}

void synchronize(const std::filesystem::path& file, int flags, const std::filesystem::path& named) {
  const FileDescriptor descriptor(::open(file.c_str(), flags | O_CLOEXEC));
  if (!descriptor) fail(named, "cannot be written", errno);
  // Some file systems cannot synchronize a directory and return EINVAL, which is harmless.
  if (::fsync(descriptor.get()) != 0 && errno != EINVAL) fail(named, "cannot be written", errno);
}

}  // namespace

std::filesystem::path shown_name(const std::filesystem::path& file) {
  static const std::regex temporary(R"(\.(.+)\.\d+\.\d+\.tmp(\.[a-z0-9]+)?)");
  std::string name = file.filename().string();
  for (std::smatch match; std::regex_match(name, match, temporary);) name = std::string(match[1]);
  return file.has_parent_path() ? file.parent_path() / name : std::filesystem::path(name);
}

OutputFile::OutputFile(const std::filesystem::path& target)
    : target_(resolve_target(target)), temporary_(temporary_beside(target_)) {
  note_output(target_);
  constexpr mode_t kMode = 0666;  // minus the user's umask
  const std::lock_guard lock(unfinished().mutex);
  const auto create = [this] {
    return FileDescriptor(
        ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kMode));
  };
  FileDescriptor descriptor = create();
  // A process of the same number, in another container or before a crash, may have left its file.
  while (!descriptor && errno == EEXIST) {
    temporary_ = temporary_beside(target_);
    descriptor = create();
  }
  if (!descriptor)
    fail(target_, "cannot create a file in this directory", errno,
         errno == ENOENT ? "create the directory first" : "");
  try {
    unfinished().files.insert(temporary_);
    note_own_file(temporary_);
  } catch (...) {  // out of memory: no destructor will remove it
    ::unlink(temporary_.c_str());
    throw;
  }
}

OutputFile::~OutputFile() {
  if (committed_) return;
  ::unlink(temporary_.c_str());
  const std::lock_guard lock(unfinished().mutex);
  unfinished().files.erase(temporary_);
}

void OutputFile::commit() {
  synchronize(temporary_, O_RDONLY, target_);
  {
    const std::lock_guard lock(unfinished().mutex);
    if (::rename(temporary_.c_str(), target_.c_str()) != 0)
      fail(target_, "cannot be moved into place", errno);
    unfinished().files.erase(temporary_);
  }
  committed_ = true;
  note_own_file(target_);
  synchronize(directory_of(target_), O_RDONLY | O_DIRECTORY, target_);
}

void remove_unfinished_files() {
  unfinished().mutex.lock();  // never unlocked: no output may be begun or committed after this
  for (const std::filesystem::path& file : unfinished().files) ::unlink(file.c_str());
}

void OutputFile::append(std::string_view text) {
  const FileDescriptor descriptor(::open(temporary_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC));
  if (!descriptor || !write_whole(descriptor, text)) fail(target_, "cannot be written", errno);
}

void write_text_file(const std::filesystem::path& target, std::string_view text) {
  OutputFile output(target);
  output.append(text);
  output.commit();
}

}  // namespace stageid
