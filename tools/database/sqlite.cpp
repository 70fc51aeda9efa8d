#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <optional>
#include <thread>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/system_reason.hpp"
#include "tools/database/database.hpp"

namespace stageid {
namespace {

/// SQLite does not wait where two processes make one new file a WAL file: it refuses one of them at once.
int enter_wal_mode(sqlite3* database) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + std::chrono::seconds(kPatience_s);
  while (true) {
    const int code =
        ::sqlite3_exec(database, "PRAGMA journal_mode = WAL", nullptr, nullptr, nullptr);
    if ((code & 0xFF) != SQLITE_BUSY || Clock::now() > end) return code;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

[[noreturn]] void fail(const std::string& name, sqlite3* database, int code) {
  switch (code & 0xFF) {
    case SQLITE_FULL:
      fail_file(name, "{}", system_reason(ENOSPC));
    case SQLITE_BUSY:
      fail_busy(name);
    case SQLITE_NOTADB:
      throw FormatError(name, "", "is not a store of 'stageid fleet'; choose another one");
    case SQLITE_CORRUPT:
      throw FormatError(name, "",
                        "is damaged; restore a copy, or delete it and run the fleet again");
    case SQLITE_CANTOPEN:
    case SQLITE_IOERR:
    case SQLITE_READONLY:
    case SQLITE_PERM: {
      const int error = ::sqlite3_system_errno(database);
      fail_file(name, "{}",
                error != 0
                    ? system_reason(error)
                    : "cannot be read or written; check permissions and free space of its disk");
    }
    case SQLITE_NOMEM:
      throw std::bad_alloc();
    default:
      fail_request("{}: {}", name, ::sqlite3_errmsg(database));
  }
}

class SqliteStatement final : public Statement {
 public:
  SqliteStatement(const std::string& name, sqlite3* database, sqlite3_stmt* statement)
      : name_(name), database_(database), statement_(statement) {}

  void start(std::span<const SqlValue> parameters) override {
    finish();
    ::sqlite3_clear_bindings(statement_.get());
    int index = 0;
    for (const SqlValue& value : parameters)
      std::visit([&](const auto& one) { put(++index, one); }, value);
  }
  bool step() override {
    const int code = ::sqlite3_step(statement_.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) fail(name_, database_, code);
    return code == SQLITE_ROW;
  }
  void run_with(std::span<const SqlValue> parameters) override {
    start(parameters);
    while (step()) {
    }
    finish();
  }
  void finish() override { ::sqlite3_reset(statement_.get()); }
  bool changes_nothing() const override { return ::sqlite3_stmt_readonly(statement_.get()) != 0; }
  int columns() const override { return ::sqlite3_column_count(statement_.get()); }
  std::string name(int column) const override {
    return ::sqlite3_column_name(statement_.get(), column);
  }
  SqlKind kind(int column) const override {
    switch (::sqlite3_column_type(statement_.get(), column)) {
      case SQLITE_NULL:
        return SqlKind::null;
      case SQLITE_INTEGER:
        return SqlKind::integer;
      case SQLITE_FLOAT:
        return SqlKind::real;
      case SQLITE_BLOB:
        return SqlKind::bytes;
      default:
        return SqlKind::text;
    }
  }
  double number(int column) const override {
    return ::sqlite3_column_double(statement_.get(), column);
  }
  std::int64_t integer(int column) const override {
    return ::sqlite3_column_int64(statement_.get(), column);
  }
  std::string text_of(int column) const override {
    const auto* text =
        reinterpret_cast<const char*>(::sqlite3_column_text(statement_.get(), column));
    return text == nullptr ? "" : text;
  }
  std::span<const std::byte> bytes(int column) const override {
    const auto* data =
        static_cast<const std::byte*>(::sqlite3_column_blob(statement_.get(), column));
    return {data, static_cast<std::size_t>(::sqlite3_column_bytes(statement_.get(), column))};
  }

 private:
  struct Free {
    void operator()(sqlite3_stmt* statement) const noexcept { ::sqlite3_finalize(statement); }
  };

  void put(int index, std::monostate) { ::sqlite3_bind_null(statement_.get(), index); }
  void put(int index, std::int64_t value) { ::sqlite3_bind_int64(statement_.get(), index, value); }
  void put(int index, double value) { ::sqlite3_bind_double(statement_.get(), index, value); }
  void put(int index, std::string_view value) {
    ::sqlite3_bind_text64(statement_.get(), index, value.data(), value.size(), SQLITE_TRANSIENT,
                          SQLITE_UTF8);
  }
  void put(int index, std::span<const std::byte> value) {
    ::sqlite3_bind_blob64(statement_.get(), index, value.data(), value.size(), SQLITE_TRANSIENT);
  }

  const std::string& name_;
  sqlite3* database_;
  std::unique_ptr<sqlite3_stmt, Free> statement_;
};

class SqliteDatabase final : public Database {
 public:
  SqliteDatabase(const std::filesystem::path& file, DatabaseAccess access)
      : Database(file.string()) {
    const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX |
                      (access == DatabaseAccess::create ? SQLITE_OPEN_CREATE : 0);
    sqlite3* handle = nullptr;
    const int opened = ::sqlite3_open_v2(file.c_str(), &handle, flags, nullptr);
    handle_.reset(handle);
    check(opened);
    ::sqlite3_extended_result_codes(handle, 1);
    ::sqlite3_busy_timeout(handle, 1000 * kPatience_s);
    execute("PRAGMA cache_size = -65536; PRAGMA trusted_schema = OFF");
    if (access == DatabaseAccess::read) {
      execute("PRAGMA query_only = ON");
      return;
    }
    // A process may end at any time without losing a committed transaction; after a power failure the last ones may be
    // missing, and their jobs run again.
    check(enter_wal_mode(handle));
    execute("PRAGMA synchronous = NORMAL; PRAGMA foreign_keys = ON");
  }

  std::unique_ptr<Statement> prepare(const std::string& sql) override {
    const char* rest = "";
    auto prepared = std::make_unique<SqliteStatement>(name(), handle_.get(), compiled(sql, rest));
    sqlite3_stmt* second = nullptr;  // remains empty after a comment
    const char* end = "";
    const int code = ::sqlite3_prepare_v2(handle_.get(), rest, -1, &second, &end);
    ::sqlite3_finalize(second);
    if (code != SQLITE_OK || second != nullptr)
      fail_request("{}: got several SQL statements; write one", name());
    return prepared;
  }
  void execute(const std::string& sql) override {
    check(::sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, nullptr));
  }
  void create(std::string_view schema) override { execute(std::string(schema)); }
  void begin() override { execute("BEGIN IMMEDIATE"); }
  std::vector<std::string> tables() override {
    std::vector<std::string> out;
    const auto rows =
        prepare("SELECT name FROM sqlite_master WHERE type IN ('table', 'view') ORDER BY name");
    while (rows->step()) out.push_back(rows->text(0));
    return out;
  }

  /// One byte of the file STORE-claims, locked: the system releases it with this process.
  bool claim(std::int64_t number) override {
    const std::string path = name() + "-claims";
    if (!claims_) claims_.emplace(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
    if (claims_->get() < 0) fail_file(path, "{}", system_reason(errno));
    if (lock(number, F_WRLCK)) return true;
    if (errno == EAGAIN || errno == EACCES) return false;
    fail_file(path, "cannot be locked: {}; put the store on a local disk", system_reason(errno));
  }
  void release(std::int64_t number) override { static_cast<void>(lock(number, F_UNLCK)); }

 private:
  struct Close {
    void operator()(sqlite3* database) const noexcept { ::sqlite3_close(database); }
  };

  void check(int code) const {
    if (code != SQLITE_OK) fail(name(), handle_.get(), code);
  }
  sqlite3_stmt* compiled(const std::string& sql, const char*& rest) {
    sqlite3_stmt* statement = nullptr;
    check(::sqlite3_prepare_v2(handle_.get(), sql.c_str(), -1, &statement, &rest));
    return statement;
  }
  bool lock(std::int64_t number, short kind) {
    struct flock lock {};
    lock.l_type = kind;
    lock.l_whence = SEEK_SET;
    lock.l_start = number;
    lock.l_len = 1;
    return ::fcntl(claims_->get(), F_OFD_SETLK, &lock) == 0;
  }

  std::unique_ptr<sqlite3, Close> handle_;
  std::optional<FileDescriptor> claims_;
};

}  // namespace

std::unique_ptr<Database> open_sqlite(const std::filesystem::path& file, DatabaseAccess access) {
  return std::make_unique<SqliteDatabase>(file, access);
}

}  // namespace stageid
