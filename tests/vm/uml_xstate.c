// Lets user-mode-linux 6.1 run on processors whose register state is larger than its buffer (AMX:
// 11008 bytes). The host kernel refuses to set a part of the state (EFAULT, "ptrace set fp regs
// failed" and a panic of the guest); here the part that UML does not know is put behind its own.
// Nobody in the guest uses those registers: they are as they were when they were read.
// vmrun.sh compiles this and puts it into LD_PRELOAD of linux.uml.
#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum { kLargest = 1 << 16 };

static __thread char whole[kLargest];  // as it was read last
static __thread size_t size;

static long get_state(pid_t pid, struct iovec* part) {
  struct iovec all = {whole, kLargest};
  long result = syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &all);
  if (result != 0) return result;
  size = all.iov_len;
  if (part->iov_len > size) part->iov_len = size;
  memcpy(part->iov_base, whole, part->iov_len);
  return 0;
}

static long set_state(pid_t pid, const struct iovec* part) {
  if (size == 0) {
    char unused[8];
    struct iovec none = {unused, sizeof(unused)};
    long result = get_state(pid, &none);
    if (result != 0) return result;
  }
  size_t given = part->iov_len < size ? part->iov_len : size;
  memcpy(whole, part->iov_base, given);
  struct iovec all = {whole, size};
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
  long word = 0;
  const int peek = request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER;
  long result = syscall(SYS_ptrace, request, pid, address, peek ? (void*)&word : data);
  return peek && result == 0 ? word : result;  // the system call stores what the library returns
}
