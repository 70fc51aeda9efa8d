// Lets user-mode-linux 6.1 run on processors whose register state is larger than its buffer (AMX: 11008 bytes). The
// host kernel refuses to set a part of the state (EFAULT, "ptrace set fp regs failed" and a panic of the guest). Here
// the part unknown to UML is appended to its own. vmrun.sh compiles this and puts it into LD_PRELOAD of linux.uml.
#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum { kLargest = 1 << 16, kKnown = 1 << 13, kProcesses = 64 };

// The processes' registers when they were last read. A process is stopped from then until it is resumed, so setting the
// same values can be skipped, which saves half of UML's time.
static struct {
  pid_t pid;
  size_t size;
  char state[kKnown];
} known[kProcesses];

static long get_state(pid_t pid, struct iovec* part) {
  long result = syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, part);
  if (result != 0 || part->iov_len > kKnown) return result;
  known[pid % kProcesses].pid = pid;
  known[pid % kProcesses].size = part->iov_len;
  memcpy(known[pid % kProcesses].state, part->iov_base, part->iov_len);
  return 0;
}

static long set_state(pid_t pid, const struct iovec* part) {
  static char whole[kLargest];
  const int slot = pid % kProcesses;
  if (known[slot].pid == pid && known[slot].size == part->iov_len &&
      memcmp(known[slot].state, part->iov_base, part->iov_len) == 0)
    return 0;
  known[slot].pid = 0;
  struct iovec all = {whole, kLargest};
  long result = syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &all);
  if (result != 0) return result;
  memcpy(whole, part->iov_base, part->iov_len < all.iov_len ? part->iov_len : all.iov_len);
  return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, &all);
}

long ptrace(enum __ptrace_request request, ...) {
  va_list arguments;
  va_start(arguments, request);
  pid_t pid = va_arg(arguments, pid_t);
  void* address = va_arg(arguments, void*);
  void* data = va_arg(arguments, void*);
  va_end(arguments);
  if (address == (void*)NT_X86_XSTATE && request == PTRACE_GETREGSET) return get_state(pid, data);
  if (address == (void*)NT_X86_XSTATE && request == PTRACE_SETREGSET) return set_state(pid, data);
  switch (request) {
    case PTRACE_SETOPTIONS:  // a new process, possibly with the number of an old one
    case PTRACE_CONT:
    case PTRACE_SYSCALL:
    case PTRACE_SINGLESTEP:
    case PTRACE_SYSEMU:
    case PTRACE_SYSEMU_SINGLESTEP:
      known[pid % kProcesses].pid = 0;
      break;
    default:
      break;
  }
  long word = 0;
  const int peek =
      request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER;
  long result = syscall(SYS_ptrace, request, pid, address, peek ? (void*)&word : data);
  return peek && result == 0 ? word : result;  // the system call stores what the library returns
}
