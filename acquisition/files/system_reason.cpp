#include "acquisition/files/system_reason.hpp"

#include <array>
#include <cerrno>
#include <system_error>

namespace stageid {
namespace {

struct Remedy {
  int error;
  const char* text;
};

constexpr std::array kRemedies = {Remedy{ENOSPC, "free some space, or write elsewhere"},
                                  Remedy{EDQUOT, "free some space, or write elsewhere"},
                                  Remedy{EFBIG, "raise the limit (ulimit -f), or write elsewhere"},
                                  Remedy{EIO, "check the disk"},
                                  Remedy{EAGAIN, "raise the limit of processes (ulimit -u)"},
                                  Remedy{EROFS, "write elsewhere"},
                                  Remedy{EACCES, "check the permissions"},
                                  Remedy{ENOENT, "check the path"},
                                  Remedy{ENOTDIR, "check the path"},
                                  Remedy{EISDIR, "give the name of a file"}};

std::string words_of(int error) {
  return std::error_code(error, std::generic_category()).message();
}

}  // namespace

std::string with_remedy(const std::string& reason) {
  for (const Remedy& remedy : kRemedies)
    if (reason.find(words_of(remedy.error)) != std::string::npos)
      return reason + "; " + remedy.text;
  return reason;
}

std::string system_reason(int error) { return with_remedy(words_of(error)); }

}  // namespace stageid
