#include "tools/fleet/child_pool.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <string_view>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

/// The end of a file in memory.
std::string last_text(int file) {
  constexpr off_t kMost = 8192;
  const off_t size = ::lseek(file, 0, SEEK_END);
  std::string text(static_cast<std::size_t>(size < kMost ? size : kMost), ' ');
  const ssize_t read = ::pread(file, text.data(), text.size(), size - std::ssize(text));
  text.resize(read > 0 ? static_cast<std::size_t>(read) : 0);
  return text;
}

std::string last_error(std::string_view text) {
  constexpr std::string_view kStart = "stageid: ";
  std::string_view found;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    if (line.starts_with(kStart)) found = line.substr(kStart.size());
    text.remove_prefix(line.size() < text.size() ? line.size() + 1 : line.size());
  }
  return std::string(found);
}

}  // namespace

// A program that ignores SIGCHLD, as some daemons let it do, cannot wait for its children.
ChildPool::ChildPool() { std::signal(SIGCHLD, SIG_DFL); }

ChildPool::~ChildPool() {
  for (const auto& [pid, child] : running_) ::kill(pid, SIGKILL);
  while (size() > 0) {
    const auto first = running_.begin();
    ::waitpid(first->first, nullptr, 0);
    ::close(first->second.messages);
    running_.erase(first);
  }
}

void ChildPool::start(std::size_t task, const std::vector<std::string>& arguments) {
  // Also this program, and this version, after its file was replaced.
  constexpr const char* kProgram = "/proc/self/exe";
  std::vector<char*> argv = {const_cast<char*>("stageid")};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const int messages = ::memfd_create("stageid messages", MFD_CLOEXEC);
  const pid_t parent = ::getpid();
  const pid_t child = messages < 0 ? -1 : ::fork();
  if (child < 0) {
    const int error = errno;
    if (messages >= 0) ::close(messages);
    throw FileError(fmt::format("cannot start a job: {}", system_reason(error)));
  }
  if (child == 0) {  // only calls that are safe between fork and exec
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(1);
    const int nothing = ::open("/dev/null", O_RDWR);
    ::dup2(nothing, STDIN_FILENO);
    ::dup2(nothing, STDOUT_FILENO);
    ::dup2(messages, STDERR_FILENO);
    ::execv(kProgram, argv.data());
    ::_exit(1);
  }
  running_[child] = {task, messages};
}

ChildEnd ChildPool::wait() {
  int status = 0;
  pid_t pid = 0;
  do pid = ::waitpid(-1, &status, 0);
  while (running_.count(pid) == 0);
  const Running child = running_[pid];
  ChildEnd end{child.task, WIFEXITED(status) ? WEXITSTATUS(status) : 0,
               WIFSIGNALED(status) ? WTERMSIG(status) : 0, last_error(last_text(child.messages))};
  ::close(child.messages);
  running_.erase(pid);
  return end;
}

}  // namespace stageid
