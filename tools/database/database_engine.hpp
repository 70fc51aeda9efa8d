#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace stageid {

enum class DatabaseAccess : unsigned char { read, write, create };

/// A parameter of a statement; monostate: null.
using SqlValue = std::variant<std::monostate, std::int64_t, double, std::string_view,
                              std::span<const std::byte>>;

enum class SqlKind : unsigned char { null, integer, real, text, bytes };

/// How long a writer waits for another one.
inline constexpr int kPatience_s = 60;
/// @throws FileError: that was too short
[[noreturn]] void fail_busy(const std::string& name);

/// A prepared statement of one kind of database.
class StatementEngine {
 public:
  virtual ~StatementEngine() = default;
  /// Ready for step() with these parameters, which it does not need any more afterwards.
  virtual void start(std::span<const SqlValue> parameters) = 0;
  virtual bool step() = 0;
  /// For a statement without rows. Within a transaction, an error may be thrown later, at the latest at its end.
  virtual void run(std::span<const SqlValue> parameters) = 0;
  /// Gives up the rows that were not read.
  virtual void finish() = 0;
  virtual bool changes_nothing() const = 0;
  virtual int columns() const = 0;
  virtual std::string name(int column) const = 0;
  // Of the current row.
  virtual SqlKind kind(int column) const = 0;
  virtual double number(int column) const = 0;
  virtual std::int64_t integer(int column) const = 0;
  virtual std::string text(int column) const = 0;  ///< not of bytes
  virtual std::span<const std::byte> bytes(int column) const = 0;
};

/// One connection to one kind of database. @throws as Database
class DatabaseEngine {
 public:
  virtual ~DatabaseEngine() = default;
  virtual std::unique_ptr<StatementEngine> prepare(const std::string& sql) = 0;
  virtual void execute(const std::string& sql) = 0;  ///< one or several statements
  /// Executes CREATE statements in the words of SQLite.
  virtual void create(const std::string& schema) = 0;
  /// Begins a transaction and waits until it is the only one that writes.
  virtual void begin() = 0;
  virtual std::vector<std::string> tables() = 0;  ///< and views, in the order of their names
  /// Claims a number until release(), or until this process ends in any way. @returns false if another one has it
  virtual bool claim(std::int64_t number) = 0;
  virtual void release(std::int64_t number) = 0;
};

std::unique_ptr<DatabaseEngine> make_sqlite_engine(const std::filesystem::path& file,
                                                   DatabaseAccess access);
std::unique_ptr<DatabaseEngine> make_postgres_engine(const std::string& url, DatabaseAccess access);

}  // namespace stageid
