#include "acquisition/files/child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <fstream>
#include <new>
#include <string_view>
#include <system_error>

#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

/// First byte of the answer.
constexpr char kDone = 'd';
constexpr char kWrongFormat = 'f';
constexpr char kNoFile = 'n';
constexpr char kNoMemory = 'm';

void limit(int resource, rlim_t most) {
  rlimit limits{};
  if (::getrlimit(static_cast<__rlimit_resource>(resource), &limits) != 0) return;
  limits.rlim_cur = std::min(limits.rlim_max, most);
  ::setrlimit(static_cast<__rlimit_resource>(resource), &limits);
}

std::size_t bytes_in_use() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

void set_limits(std::size_t file_bytes) {
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, kChildSeconds + file_bytes / kBytesPerSecond);
  limit(RLIMIT_AS, bytes_in_use() + kChildBytes + kChildBytesPerByte * file_bytes);
}

[[noreturn]] void work_and_end(const FileDescriptor& to, std::size_t file_bytes,
                               const std::function<std::string()>& work) noexcept {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  // A crash is the parent's to report, not that of a handler for crashes.
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGABRT, SIGXCPU}) std::signal(signal, SIG_DFL);
  set_limits(file_bytes);
  char answer = kDone;
  std::string text;
  try {
    text = work();
  } catch (const FormatError& error) {
    answer = kWrongFormat;
    text = error.what();
  } catch (const FileError& error) {
    answer = kNoFile;
    text = error.what();
  } catch (const std::bad_alloc&) {
    answer = kNoMemory;
  } catch (...) {
    ::_exit(1);
  }
  const bool sent = write_whole(to, std::string_view(&answer, 1)) && write_whole(to, text);
  ::_exit(sent ? 0 : 1);
}

}  // namespace

std::string in_child(const std::filesystem::path& file, const std::function<std::string()>& work) {
  std::error_code ignored;
  const std::uintmax_t size = std::filesystem::file_size(file, ignored);
  const std::size_t file_bytes = ignored ? 0 : static_cast<std::size_t>(size);
  const auto cannot = [&](int error) {
    return FileError(fmt::format("{}: cannot be read: {}", file.string(), system_reason(error)));
  };
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw cannot(errno);
  FileDescriptor from(ends[0]);
  FileDescriptor to(ends[1]);
  const pid_t child = ::fork();
  if (child == 0) {
    from.reset();
    work_and_end(to, file_bytes, work);
  }
  const int error = errno;
  to.reset();
  std::string answer;
  try {
    if (child > 0) static_cast<void>(read_to_end(from, answer));
  } catch (const std::bad_alloc&) {
    answer = kNoMemory;
  }
  from.reset();
  if (child < 0) throw cannot(error);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  const char kind = answer.empty() ? '\0' : answer.front();
  answer.erase(0, 1);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    if (kind == kDone) return answer;
    if (kind == kWrongFormat) throw FormatError(answer);
    if (kind == kNoFile) throw FileError(answer);
  }
  if (kind == kNoMemory)
    throw FormatError(file, "",
                      "needs far more memory than its size explains; the file is damaged. Copy it "
                      "again or recreate it");
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGKILL || WTERMSIG(status) == SIGXCPU))
    throw FormatError(file, "",
                      "takes far longer to read than its size explains; the file is damaged. Copy "
                      "it again or recreate it");
  throw FormatError(file, "",
                    "crashes the library that reads it; the file is damaged. Copy it again or "
                    "recreate it");
}

}  // namespace stageid
