#include "tools/program_main.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/system_reason.hpp"
#include "estimation/problem/freed_memory.hpp"
#include "estimation/problem/weight_matrices.hpp"
#include "hal/stage/stage.hpp"
#include "tools/commands/program.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/format_errors.hpp"
#include "tools/terminal/interrupt.hpp"

namespace {

/// Otherwise a file would be opened as a closed standard stream, and messages written into it.
void open_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0) static_cast<void>(::open("/dev/null", O_RDWR));
}

bool has_ended = false;
bool json_wanted = false;  // --json
const stageid::Team* the_team = &stageid::Team::one();

/// HDF5 calls exit() when it is out of memory.
void end_after_library() {
  if (has_ended) return;
  stageid::remove_unfinished_files();
  constexpr std::string_view kMessage =
      "stageid: out of memory within a library; free some memory\n";
  static_cast<void>(!::write(STDERR_FILENO, kMessage.data(), kMessage.size()));
  ::_exit(stageid::kWorldFailed);
}

int report(const std::vector<std::string>& errors, int exit_code) {
  has_ended = true;
  the_team->fail(errors.front(), exit_code);
  stageid::wait_if_ending();
  stageid::Console console;
  console.json = json_wanted;
  for (const std::string& error : errors) console.warning(error);
  console.result({{"errors", errors}, {"exit_code", exit_code}});
  return exit_code;
}

int report(const std::exception& error, int exit_code) {
  return report(std::vector<std::string>{error.what()}, exit_code);
}

std::vector<std::string> texts_of(const stageid::FormatErrors& errors) {
  std::vector<std::string> texts;
  for (const stageid::FormatError& error : errors.all()) texts.emplace_back(error.what());
  return texts;
}

}  // namespace

int stageid::program_main(int argc, char** argv, const Team& team) {
  the_team = &team;
  open_standard_streams();
  std::atexit(end_after_library);
  json_wanted = std::find(argv, argv + argc, std::string_view("--json")) != argv + argc;
  try {
    stageid::catch_signals();  // as early as possible
    stageid::protect_inputs();
    stageid::keep_freed_memory();
    const int exit_code = stageid::run_program(argc, argv, team);
    has_ended = true;
    return exit_code;
  } catch (const stageid::TeamFailed& failure) {
    return report(failure, failure.exit_code());
  } catch (const stageid::Interrupted& error) {
    return report(error, stageid::kInterrupted);
  } catch (const stageid::FormatErrors& errors) {
    return report(texts_of(errors), stageid::kRequestWrong);
  } catch (const stageid::FormatError& error) {
    return report(error, stageid::kRequestWrong);
  } catch (const stageid::FileError& error) {
    return report(error, stageid::kWorldFailed);
  } catch (const stageid::StageError& error) {
    return report(error, stageid::kWorldFailed);
  } catch (const std::filesystem::filesystem_error& error) {
    return report(stageid::FileError(error.path1().string() + ": " +
                                     stageid::system_reason(error.code().value())),
                  stageid::kWorldFailed);
  } catch (const stageid::IndefiniteWeights& error) {
    return report(error, stageid::kNotTrustworthy);
  } catch (const std::invalid_argument& error) {
    return report(error, stageid::kRequestWrong);
  } catch (const std::system_error& error) {
    return report(std::runtime_error("the system refused a resource: " +
                                     stageid::system_reason(error.code().value())),
                  stageid::kWorldFailed);
  } catch (const std::bad_alloc&) {
    return report(
        std::runtime_error("out of memory; reduce the number of lines, channels or modes"),
        stageid::kWorldFailed);
  } catch (const std::exception&) {
    // The text of a library exception would not help users.
    return report(
        std::runtime_error(
            "unexpected error, a bug in stageid; report the command with its input files"),
        stageid::kWorldFailed);
  }
}
