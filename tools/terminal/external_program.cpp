#include "tools/terminal/external_program.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

std::atomic<pid_t> running = -1;

/// The first word that sets no variable.
std::string name_of(const std::vector<std::string>& words) {
  return *std::ranges::find_if(
      words, [](const std::string& word) { return word.find('=') == std::string::npos; });
}

pid_t spawned(const std::vector<std::string>& words, const std::filesystem::path& directory,
              int messages) {
  std::vector<std::string> all = {"/usr/bin/env", "LC_ALL=C.UTF-8"};
  all.insert(all.end(), words.begin(), words.end());
  std::vector<char*> arguments;
  for (std::string& word : all) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (!directory.empty()) posix_spawn_file_actions_addchdir_np(&actions, directory.c_str());
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, messages, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, messages, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  ::sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  pid_t child = -1;
  const int error =
      ::posix_spawn(&child, all[0].c_str(), &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) fail_file(name_of(words), "cannot be started: {}", system_reason(error));
  return child;
}

}  // namespace

ExternalEnd run_external(const std::vector<std::string>& words,
                         const std::filesystem::path& directory, const std::string& package) {
  const FileDescriptor messages(::memfd_create("stageid messages", MFD_CLOEXEC));
  if (messages.get() < 0) fail_file(name_of(words), "cannot be started: {}", system_reason(errno));
  const pid_t child = spawned(words, directory, messages.get());
  running = child;
  ExternalEnd end;
  while (::waitpid(child, &end.status, 0) < 0 && errno == EINTR) {
  }
  running = -1;
  constexpr int kNotFound = 127;  // of env
  if (WIFEXITED(end.status) && WEXITSTATUS(end.status) == kNotFound)
    fail_file(name_of(words), "not installed; install the Debian package {}", package);
  end.messages.resize(::lseek(messages.get(), 0, SEEK_END));
  const ssize_t size = ::pread(messages.get(), end.messages.data(), end.messages.size(), 0);
  end.messages.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return end;
}

void kill_external() noexcept {
  if (const pid_t child = running; child > 0) ::kill(child, SIGKILL);
}

}  // namespace stageid
