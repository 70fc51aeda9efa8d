#include "tools/fleet/database.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <utility>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

constexpr int kPatience_ms = 60000;

/// SQLite does not wait where two processes make one new file a WAL file: it refuses one of them at once.
int enter_wal_mode(sqlite3* database) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + std::chrono::milliseconds(kPatience_ms);
  while (true) {
    const int code =
        ::sqlite3_exec(database, "PRAGMA journal_mode = WAL", nullptr, nullptr, nullptr);
    if ((code & 0xFF) != SQLITE_BUSY || Clock::now() > end) return code;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace

void Statement::Free::operator()(sqlite3_stmt* statement) const noexcept {
  ::sqlite3_finalize(statement);
}

void Statement::restart() {
  ::sqlite3_reset(statement_.get());
  ::sqlite3_clear_bindings(statement_.get());
}

bool Statement::step() {
  const int code = ::sqlite3_step(statement_.get());
  if (code != SQLITE_ROW && code != SQLITE_DONE) database_->fail(code);
  return code == SQLITE_ROW;
}

void Statement::put(int index, std::int64_t value) {
  ::sqlite3_bind_int64(statement_.get(), index, value);
}

void Statement::put(int index, double value) {
  if (std::isfinite(value)) ::sqlite3_bind_double(statement_.get(), index, value);
}

void Statement::put(int index, const std::string& value) {
  ::sqlite3_bind_text64(statement_.get(), index, value.data(), value.size(), SQLITE_TRANSIENT,
                        SQLITE_UTF8);
}

void Statement::put(int index, const std::vector<std::complex<float>>& value) {
  if (!value.empty())
    ::sqlite3_bind_blob64(statement_.get(), index, value.data(),
                          value.size() * sizeof(std::complex<float>), SQLITE_TRANSIENT);
}

bool Statement::changes_nothing() const { return ::sqlite3_stmt_readonly(statement_.get()) != 0; }
int Statement::columns() const { return ::sqlite3_column_count(statement_.get()); }
std::string Statement::name(int column) const {
  return ::sqlite3_column_name(statement_.get(), column);
}
bool Statement::is_null(int column) const {
  return ::sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}
bool Statement::is_integer(int column) const {
  return ::sqlite3_column_type(statement_.get(), column) == SQLITE_INTEGER;
}
bool Statement::is_real(int column) const {
  return ::sqlite3_column_type(statement_.get(), column) == SQLITE_FLOAT;
}
double Statement::number(int column) const {
  return ::sqlite3_column_double(statement_.get(), column);
}
std::int64_t Statement::integer(int column) const {
  return ::sqlite3_column_int64(statement_.get(), column);
}
std::string Statement::text(int column) const {
  if (::sqlite3_column_type(statement_.get(), column) == SQLITE_BLOB) {
    std::string digits;
    for (const std::byte byte : bytes(column))
      digits += fmt::format("{:02x}", std::to_integer<unsigned>(byte));
    return digits;
  }
  const auto* text = reinterpret_cast<const char*>(::sqlite3_column_text(statement_.get(), column));
  return text == nullptr ? "" : text;
}
std::span<const std::byte> Statement::bytes(int column) const {
  const auto* data = static_cast<const std::byte*>(::sqlite3_column_blob(statement_.get(), column));
  return {data, static_cast<std::size_t>(::sqlite3_column_bytes(statement_.get(), column))};
}

void Database::Close::operator()(sqlite3* database) const noexcept { ::sqlite3_close(database); }

Database::Database(std::filesystem::path file, Access access) : file_(std::move(file)) {
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX |
                    (access == Access::create ? SQLITE_OPEN_CREATE : 0);
  sqlite3* handle = nullptr;
  const int code = ::sqlite3_open_v2(file_.c_str(), &handle, flags, nullptr);
  handle_.reset(handle);
  if (code != SQLITE_OK) fail(code);
  ::sqlite3_extended_result_codes(handle, 1);
  ::sqlite3_busy_timeout(handle, kPatience_ms);
  // A process may end at any time without losing a committed transaction; after a power failure the last ones may be
  // missing, and their jobs run again.
  execute("PRAGMA cache_size = -65536; PRAGMA trusted_schema = OFF");
  if (access == Access::read) {
    execute("PRAGMA query_only = ON");
    return;
  }
  if (const int wal_code = enter_wal_mode(handle); wal_code != SQLITE_OK) fail(wal_code);
  execute("PRAGMA synchronous = NORMAL; PRAGMA foreign_keys = ON");
}

Statement Database::prepare(const std::string& sql) const {
  sqlite3_stmt* statement = nullptr;
  const char* rest = "";
  const int code = ::sqlite3_prepare_v2(handle_.get(), sql.c_str(), -1, &statement, &rest);
  Statement prepared(*this, statement);
  if (code != SQLITE_OK) fail(code);
  sqlite3_stmt* second = nullptr;  // remains empty after a comment
  const int code_of_rest = ::sqlite3_prepare_v2(handle_.get(), rest, -1, &second, nullptr);
  const Statement not_used(*this, second);
  if (code_of_rest != SQLITE_OK || second != nullptr)
    throw std::invalid_argument(
        fmt::format("{}: got several SQL statements; write one", file_.string()));
  return prepared;
}

void Database::execute(const std::string& sql) const {
  const int code = ::sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
}

std::int64_t Database::last_id() const { return ::sqlite3_last_insert_rowid(handle_.get()); }

void Database::fail(int code) const {
  const std::string name = file_.string();
  switch (code & 0xFF) {
    case SQLITE_FULL:
      throw FileError(fmt::format("{}: {}", name, system_reason(ENOSPC)));
    case SQLITE_BUSY:
      throw FileError(fmt::format(
          "{}: another process has been writing for {} s; run the command again when it has ended",
          name, kPatience_ms / 1000));
    case SQLITE_NOTADB:
      throw FormatError(file_, "", "is not a store of 'stageid fleet'; choose another file");
    case SQLITE_CORRUPT:
      throw FormatError(file_, "",
                        "is damaged; restore a copy, or delete it and run the fleet again");
    case SQLITE_CANTOPEN:
    case SQLITE_IOERR:
    case SQLITE_READONLY:
    case SQLITE_PERM: {
      const int error = ::sqlite3_system_errno(handle_.get());
      throw FileError(fmt::format(
          "{}: {}", name,
          error != 0 ? system_reason(error)
                     : "cannot be read or written; check permissions and free space of its disk"));
    }
    case SQLITE_NOMEM:
      throw std::bad_alloc();
    default:
      throw std::invalid_argument(fmt::format("{}: {}", name, ::sqlite3_errmsg(handle_.get())));
  }
}

Transaction::Transaction(const Database& database) : database_(database) {
  database_.execute("BEGIN IMMEDIATE");
}

Transaction::~Transaction() {
  if (!open_) return;
  try {
    database_.execute("ROLLBACK");
  } catch (...) {  // after a full disk, SQLite has rolled back already
  }
}

void Transaction::commit() {
  database_.execute("COMMIT");
  open_ = false;
}

}  // namespace stageid
