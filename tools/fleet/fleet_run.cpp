#include "tools/fleet/fleet_run.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/system_reason.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "tools/fleet/fleet_store.hpp"
#include "tools/fleet/identify_log.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

/// How often jobs of other processes are looked at.
constexpr std::chrono::milliseconds kLook{200};

struct Job {
  FleetLog log;
  std::string fingerprint;
  std::string id;
  std::int64_t claim() const { return std::stoll(id.substr(0, 15), nullptr, 16); }
};

std::vector<std::string> arguments_of(const Job& job, const FleetConfig& config) {
  std::vector<std::string> out = {"--verbosity", "quiet", "fleet", "job"};
  if (!job.log.stage.empty()) out.push_back("--stage=" + job.log.stage);
  if (!job.log.time_utc.empty()) out.push_back("--time=" + job.log.time_utc);
  for (const auto& [name, value] : job.log.tags)
    out.push_back(fmt::format("--tag={}={}", name, value));
  for (const std::string& name : {std::string("--"), config.file.string(), job.log.file.string()})
    out.push_back(name);
  return out;
}

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

/// How a child process ended.
struct ChildEnd {
  std::size_t task = 0;
  int exit_code = 0;    ///< of an ordinary end
  int signal = 0;       ///< that killed it; 0: ordinary end
  std::string message;  ///< its last error on stderr, without "stageid: "
};

/// Child processes that run this program. They end with it, whatever ends it.
class ChildPool {
 public:
  // A program that ignores SIGCHLD, as some daemons let it do, cannot wait for its children.
  ChildPool() { std::signal(SIGCHLD, SIG_DFL); }
  /// Kills those that are running.
  ~ChildPool() {
    for (const auto& [pid, child] : running_) ::kill(pid, SIGKILL);
    for (const auto& [pid, child] : running_) ::waitpid(pid, nullptr, 0);
  }
  ChildPool(ChildPool&&) = delete;

  std::size_t size() const noexcept { return running_.size(); }

  /// Starts this program with arguments. @throws FileError if the system cannot
  void start(std::size_t task, const std::vector<std::string>& arguments) {
    // Also this program, and this version, after its file was replaced.
    constexpr const char* kProgram = "/proc/self/exe";
    std::vector<char*> argv = {const_cast<char*>("stageid")};
    for (const std::string& argument : arguments)
      argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    FileDescriptor messages(::memfd_create("stageid messages", MFD_CLOEXEC));
    const pid_t parent = ::getpid();
    const pid_t child = messages ? ::fork() : -1;
    if (child < 0) throw FileError("cannot start a job: " + system_reason(errno));
    if (child == 0) {  // only calls that are safe between fork and exec
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (::getppid() != parent) ::_exit(1);
      const int nothing = ::open("/dev/null", O_RDWR);
      ::dup2(nothing, STDIN_FILENO);
      ::dup2(nothing, STDOUT_FILENO);
      ::dup2(messages.get(), STDERR_FILENO);
      ::execv(kProgram, argv.data());
      ::_exit(1);
    }
    running_[child] = {task, std::move(messages)};
  }

  /// Waits for one to end. @pre size() > 0
  ChildEnd wait() {
    int status = 0;
    pid_t pid = 0;
    do pid = ::waitpid(-1, &status, 0);
    while (!running_.contains(pid));
    const Running child = std::move(running_.extract(pid).mapped());
    return {child.task, WIFEXITED(status) ? WEXITSTATUS(status) : 0,
            WIFSIGNALED(status) ? WTERMSIG(status) : 0,
            last_error(last_text(child.messages.get()))};
  }

 private:
  struct Running {
    std::size_t task = 0;
    FileDescriptor messages;  ///< file of its stderr
  };
  std::map<pid_t, Running> running_;
};

class FleetRun {
 public:
  FleetRun(const FleetConfig& config, const Console& console)
      : config_(config),
        console_(console),
        store_(config.store, DatabaseAccess::create),
        progress_(console, "fleet", "jobs") {}

  /// The jobs that are not done. Their fingerprints are stored, so that others need not read the logs for them.
  std::size_t find_jobs(const std::vector<FleetLog>& logs) {
    const std::map<std::string, JobState> stored = store_.jobs();
    std::set<std::string> known;
    for (const FleetLog& log : logs) {
      try {
        Job job{log, log_fingerprint(store_, log.file), ""};
        job.id = job_id(job.fingerprint, config_);
        if (known.insert(job.id).second) add(std::move(job), stored);  // else a copy
      } catch (const FileError& error) {
        ++summary_.failed;
        console_.warning(error.what());
      }
    }
    summary_.jobs = known.size() + summary_.failed;
    return jobs_.size();
  }

  FleetSummary run(const std::vector<FleetLog>& logs, std::size_t workers) {
    find_jobs(logs);
    for (std::size_t i = 0; i < jobs_.size(); ++i) open_.push_back(i);
    while (!open_.empty() || pool_.size() > 0) {
      throw_if_interrupted();
      start_jobs(workers);
      if (pool_.size() > 0)
        finish(pool_.wait());
      else if (!open_.empty())
        wait_for_others();
      progress_.update(static_cast<double>(jobs_.size() - open_.size() - pool_.size()),
                       static_cast<double>(jobs_.size()));
    }
    return summary_;
  }

 private:
  void add(Job job, const std::map<std::string, JobState>& stored) {
    const auto found = stored.find(job.id);
    const JobState state = found == stored.end() ? JobState::none : found->second;
    if (state == JobState::failed) failed_before_[job.id] = store_.failure(job.id);
    if (!is_done(state)) {
      jobs_.push_back(std::move(job));
      return;
    }
    ++summary_.done_before;
    if (state == JobState::superseded) store_.make_current(job.id);  // options used before
  }

  /// Starts jobs while there are workers. Those that other processes run remain open, in case these end early.
  void start_jobs(std::size_t workers) {
    for (std::size_t left = open_.size(); left > 0 && pool_.size() < workers; --left) {
      const std::size_t index = open_.front();
      open_.pop_front();
      const Job& job = jobs_[index];
      if (!store_.database().claim(job.claim())) {
        open_.push_back(index);
        continue;
      }
      // Other processes may have run it since find_jobs().
      const JobState state = store_.state_of(job.id);
      const bool done = is_done(state);
      const bool failed = state == JobState::failed && !is_failure_before(job.id);
      if (done || failed) {
        ++(done ? summary_.done_before : summary_.failed);
        store_.database().release(job.claim());
      } else {
        pool_.start(index, arguments_of(job, config_));
      }
    }
  }

  /// Whether a failure was stored before this call: such jobs run again, but in one process only.
  bool is_failure_before(const std::string& job) {
    const auto before = failed_before_.find(job);
    return before != failed_before_.end() && before->second == store_.failure(job);
  }

  void wait_for_others() {
    if (!waiting_)
      console_.message("{} by other processes; waiting for them",
                       counted(open_.size(), "job is run", "jobs are run"));
    waiting_ = true;
    std::this_thread::sleep_for(kLook);
  }

  void finish(const ChildEnd& end) {
    const Job& job = jobs_[end.task];
    if (end.signal == 0 && (end.exit_code == kDone || end.exit_code == kNotTrustworthy)) {
      ++summary_.done;
      if (end.exit_code == kNotTrustworthy) ++summary_.not_trustworthy;
    } else {
      ++summary_.failed;
      Identification failed = described_job(config_, job.log, job.fingerprint);
      failed.results.clear();
      failed.reasons = reason_of(end, job);
      store_.add(failed);
      console_.warning(failed.reasons);
    }
    store_.database().release(job.claim());
  }

  static std::string reason_of(const ChildEnd& end, const Job& job) {
    if (end.signal != 0)
      return fmt::format("{}: the process of this job was ended by signal {} ({})",
                         job.log.file.string(), end.signal, ::strsignal(end.signal));
    if (end.message.empty())
      return fmt::format("{}: the job ended with exit code {}", job.log.file.string(),
                         end.exit_code);
    return end.message.find(job.log.file.string()) == std::string::npos
               ? fmt::format("{}: {}", job.log.file.string(), end.message)
               : end.message;
  }

  const FleetConfig& config_;
  const Console& console_;
  FleetStore store_;
  Progress progress_;
  std::vector<Job> jobs_;
  std::map<std::string, std::optional<std::int64_t>> failed_before_;  ///< see FleetStore::failure()
  std::deque<std::size_t>
      open_;  ///< jobs that are neither run by this process nor known to be done
  bool waiting_ = false;
  ChildPool pool_;
  FleetSummary summary_;
};

}  // namespace

std::size_t open_jobs(const FleetConfig& config, const std::vector<FleetLog>& logs,
                      const Console& console) {
  return FleetRun(config, console).find_jobs(logs);
}

FleetSummary run_fleet(const FleetConfig& config, const std::vector<FleetLog>& logs, int workers,
                       const Console& console) {
  return FleetRun(config, console).run(logs, static_cast<std::size_t>(worker_count(workers)));
}

}  // namespace stageid
