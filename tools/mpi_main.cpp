// The program for MPI: mpirun -n COUNT stageid-mpi COMMAND ... The only source that includes <mpi.h>.
#include <fcntl.h>
#include <mpi.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <initializer_list>
#include <span>
#include <string>
#include <thread>

#include "excitation/threads/team.hpp"
#include "tools/program_main.hpp"
#include "tools/terminal/interrupt.hpp"

namespace {

constexpr std::size_t kLargestMessage = std::size_t{1} << 30;  // MPI counts in int
constexpr int kData = 0;
constexpr int kFailure = 1;
constexpr int kSpins = 1000;  // polls before a wait begins to sleep
constexpr std::chrono::microseconds kNap{50};

struct Failure {
  int exit_code = 0;
  std::array<char, 1000> what{};
};

class MpiTeam : public stageid::Team {
 public:
  MpiTeam() : Team(number_from(MPI_Comm_rank), number_from(MPI_Comm_size)) {
    MPI_Irecv(&failure_, sizeof failure_, MPI_BYTE, MPI_ANY_SOURCE, kFailure, MPI_COMM_WORLD,
              &failed_);
  }
  ~MpiTeam() override {
    if (failed_ != MPI_REQUEST_NULL) MPI_Cancel(&failed_);
    if (failed_ != MPI_REQUEST_NULL) MPI_Request_free(&failed_);
  }

  void fail(const std::string& what, int exit_code) const override {
    Failure failure{exit_code, {}};
    std::copy_n(what.data(), std::min(what.size(), failure.what.size() - 1), failure.what.data());
    for (int other = 0; other < size(); ++other)
      if (other != rank())
        MPI_Send(&failure, sizeof failure, MPI_BYTE, other, kFailure, MPI_COMM_WORLD);
  }

 private:
  static int number_from(int (*ask)(MPI_Comm, int*)) {
    int number = 0;
    ask(MPI_COMM_WORLD, &number);
    return number;
  }

  void deliver(int to, std::span<const std::byte> bytes) const override {
    for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), kLargestMessage))) {
      MPI_Request sent{};
      MPI_Isend(bytes.data(), count_of(bytes), MPI_BYTE, to, kData, MPI_COMM_WORLD, &sent);
      wait_for(sent);
    }
  }

  void receive(int from, std::span<std::byte> bytes) const override {
    for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), kLargestMessage))) {
      MPI_Request received{};
      MPI_Irecv(bytes.data(), count_of(bytes), MPI_BYTE, from, kData, MPI_COMM_WORLD, &received);
      wait_for(received);
    }
  }

  static int count_of(std::span<const std::byte> bytes) {
    return static_cast<int>(std::min(bytes.size(), kLargestMessage));
  }

  /// Leaves the core to others, because there may be more processes than cores.
  void wait_for(MPI_Request& request) const {
    for (int i = 0;; ++i) {
      std::array<MPI_Request, 2> both{request, failed_};
      int which = MPI_UNDEFINED;
      int done = 0;
      MPI_Testany(2, both.data(), &which, &done, MPI_STATUS_IGNORE);
      if (done != 0 && which == 0) return;
      if (done != 0) {
        failed_ = MPI_REQUEST_NULL;
        MPI_Cancel(&request);
        MPI_Request_free(&request);
        throw stageid::TeamFailed(failure_.what.data(), failure_.exit_code);
      }
      if (i < kSpins)
        std::this_thread::yield();
      else
        std::this_thread::sleep_for(kNap);
    }
  }

  mutable MPI_Request failed_{};
  mutable Failure failure_;
};

void be_silent(std::initializer_list<int> streams) {
  const int nowhere = ::open("/dev/null", O_RDWR);
  for (const int stream : streams) ::dup2(nowhere, stream);
}

}  // namespace

int main(int argc, char** argv) {
  int thread_support = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &thread_support);
  int exit_code = EXIT_FAILURE;
  {
    const MpiTeam team;
    // A process leaves the rows of others unwritten (ChannelData); a huge page would contain them.
    if (team.size() > 1) ::prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0);
    // Results and messages are those of the first process; the others send it their errors.
    if (team.rank() > 0) be_silent({STDOUT_FILENO, STDERR_FILENO});
    exit_code = stageid::program_main(argc, argv, team);
  }
  // Once one process has ended with an error, mpirun sends SIGTERM to the others, more than once to a slow one. They
  // have reported already.
  const stageid::ControlledStop ends_by_itself;
  be_silent({STDERR_FILENO});
  MPI_Finalize();
  return exit_code;
}
