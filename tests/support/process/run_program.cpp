#include "tests/support/process/run_program.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <stdexcept>
#include <thread>

#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test {
namespace {

void redirect(const char* file, int flags, int descriptor) {
  const int opened = ::open(file, flags, 0600);
  if (opened < 0 || ::dup2(opened, descriptor) < 0) ::_exit(127);
}

[[noreturn]] void become(const std::string& program, std::vector<char*>& argv,
                         const std::string& out, const std::string& err,
                         const ProgramOptions& options) {
  redirect("/dev/null", O_RDONLY, STDIN_FILENO);
  redirect(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, STDOUT_FILENO);
  redirect(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, STDERR_FILENO);
  if (!options.working_directory.empty() && ::chdir(options.working_directory.c_str()) != 0)
    ::_exit(127);
  if (options.largest_file_bytes >= 0) {
    const rlimit limit = {static_cast<rlim_t>(options.largest_file_bytes),
                          static_cast<rlim_t>(options.largest_file_bytes)};
    if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) ::_exit(127);
  }
  ::execv(program.c_str(), argv.data());
  ::_exit(127);
}

/// Until `file` is there, or the child has ended. @returns whether it is there
bool wait_for_file(const std::filesystem::path& file, pid_t child) {
  while (!std::filesystem::exists(file)) {
    siginfo_t ended{};
    // WNOWAIT: the status is left for waitpid().
    if (::waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT) != 0 ||
        ended.si_pid == child)
      return std::filesystem::exists(file);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

void interrupt(pid_t child, const ProgramOptions& options) {
  if (!options.interrupt_after_file.empty() && !wait_for_file(options.interrupt_after_file, child))
    return;
  std::this_thread::sleep_for(std::chrono::duration<double>(options.interrupt_after_s));
  ::kill(child, SIGINT);
}

}  // namespace

ProgramResult run_program(const std::filesystem::path& program,
                          const std::vector<std::string>& arguments,
                          const ProgramOptions& options) {
  const TemporaryDirectory scratch;
  const std::string name = program.string();
  const std::string out = (scratch / "out").string();
  const std::string err = (scratch / "err").string();
  std::vector<std::string> words = {name};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error("fork failed");
  if (child == 0) become(name, argv, out, err, options);
  if (options.interrupt_after_s >= 0.0) interrupt(child, options);
  int status = 0;
  ::waitpid(child, &status, 0);
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return {code, read_bytes(out), read_bytes(err)};
}

}  // namespace stageid::test
