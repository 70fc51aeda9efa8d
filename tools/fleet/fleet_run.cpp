#include "tools/fleet/fleet_run.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <map>
#include <set>
#include <string>

#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/system_reason.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "tools/fleet/child_pool.hpp"
#include "tools/fleet/fleet_store.hpp"
#include "tools/fleet/identify_log.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

/// Claims of jobs among processes: one byte each of the file STORE-claims, locked.
class Claims {
 public:
  explicit Claims(const std::filesystem::path& store)
      : path_(store.string() + "-claims"),
        file_(::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
    if (file_.get() < 0) throw FileError(fmt::format("{}: {}", path_, system_reason(errno)));
  }
  /// @returns false if another process has it   @throws FileError if the file system cannot lock
  bool claim(const std::string& job) {
    if (set(job, F_WRLCK)) return true;
    if (errno == EAGAIN || errno == EACCES) return false;
    throw FileError(fmt::format("{}: cannot be locked: {}; put the store on a local disk", path_,
                                system_reason(errno)));
  }
  void release(const std::string& job) { static_cast<void>(set(job, F_UNLCK)); }

 private:
  bool set(const std::string& job, short kind) {
    struct flock lock {};
    lock.l_type = kind;
    lock.l_whence = SEEK_SET;
    lock.l_start = std::stoll(job.substr(0, 15), nullptr, 16);
    lock.l_len = 1;
    return ::fcntl(file_.get(), F_OFD_SETLK, &lock) == 0;
  }
  std::string path_;
  FileDescriptor file_;
};

struct Job {
  FleetLog log;
  std::string fingerprint;
  std::string id;
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

class FleetRun {
 public:
  FleetRun(const FleetConfig& config, const Console& console)
      : config_(config),
        console_(console),
        store_(config.store, Database::Access::create),
        claims_(config.store),
        progress_(console, "fleet", "jobs") {}

  FleetSummary run(const std::vector<FleetLog>& logs, std::size_t workers) {
    find_jobs(logs);
    std::size_t next = 0;
    while (next < jobs_.size() || pool_.size() > 0) {
      throw_if_interrupted();
      while (pool_.size() < workers && next < jobs_.size()) start(next++);
      if (pool_.size() > 0) finish(pool_.wait());
      progress_.update(static_cast<double>(summary_.done + summary_.failed),
                       static_cast<double>(jobs_.size()));
    }
    return summary_;
  }

 private:
  void find_jobs(const std::vector<FleetLog>& logs) {
    const std::map<std::string, bool> done = store_.done_jobs();
    std::set<std::string> known;
    for (const FleetLog& log : logs) {
      try {
        Job job{log, log_fingerprint(store_, log.file), ""};
        job.id = job_id(job.fingerprint, config_);
        if (!known.insert(job.id).second) continue;  // a copy of another log
        const auto found = done.find(job.id);
        if (found == done.end()) {
          jobs_.push_back(std::move(job));
          continue;
        }
        ++summary_.done_before;
        if (!found->second) store_.make_current(job.id);  // options that were used before
      } catch (const FileError& error) {
        ++summary_.failed;
        console_.warning(error.what());
      }
    }
    summary_.jobs = known.size() + summary_.failed;
  }

  void start(std::size_t index) {
    const Job& job = jobs_[index];
    if (!claims_.claim(job.id)) {
      ++summary_.elsewhere;
    } else if (store_.is_done(job.id)) {  // by another process, since find_jobs()
      ++summary_.done_before;
      claims_.release(job.id);
    } else {
      pool_.start(index, arguments_of(job, config_));
    }
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
    claims_.release(job.id);
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
  Claims claims_;
  Progress progress_;
  std::vector<Job> jobs_;
  ChildPool pool_;
  FleetSummary summary_;
};

}  // namespace

FleetSummary run_fleet(const FleetConfig& config, const std::vector<FleetLog>& logs, int workers,
                       const Console& console) {
  return FleetRun(config, console).run(logs, static_cast<std::size_t>(worker_count(workers)));
}

}  // namespace stageid
