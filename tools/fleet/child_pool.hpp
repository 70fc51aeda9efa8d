#pragma once

#include <sys/types.h>

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace stageid {

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
  ChildPool();
  ~ChildPool();  ///< kills those that are running
  ChildPool(ChildPool&&) = delete;

  std::size_t size() const noexcept { return running_.size(); }
  /// Starts this program with arguments. @throws FileError if the system cannot
  void start(std::size_t task, const std::vector<std::string>& arguments);
  /// Waits for one to end. @pre size() > 0
  ChildEnd wait();

 private:
  struct Running {
    std::size_t task = 0;
    int messages = -1;  ///< file of its stderr
  };
  std::map<pid_t, Running> running_;
};

}  // namespace stageid
