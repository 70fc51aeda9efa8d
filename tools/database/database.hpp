#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace stageid {

/// A parameter of a statement; monostate: null.
using SqlValue = std::variant<std::monostate, std::int64_t, double, std::string_view,
                              std::span<const std::byte>>;

enum class SqlKind : unsigned char { null, integer, real, text, bytes };

/// How long a writer waits for another one.
inline constexpr int kPatience_s = 60;
/// @throws FileError: that was too short
[[noreturn]] void fail_busy(const std::string& name);

/// One SQL statement, prepared once and executed repeatedly. Parameters are written as ?. @throws as open_database()
class Statement {
 public:
  Statement() = default;
  Statement(Statement&&) = delete;
  virtual ~Statement() = default;

  /// Takes the parameters in order and is ready for step(). Numbers that are not finite are null.
  template <typename... Values>
  Statement& bind(const Values&... values) {
    start(std::array<SqlValue, sizeof...(Values)>{sql_value(values)...});
    return *this;
  }
  /// The next row; false after the last one.
  virtual bool step() = 0;
  /// For a statement without rows. Within a Transaction, an error may be thrown later, at the latest by commit().
  template <typename... Values>
  void run(const Values&... values) {
    run_with(std::array<SqlValue, sizeof...(Values)>{sql_value(values)...});
  }
  /// The number in the first column of the first row; none if there is no row.
  template <typename... Values>
  std::optional<std::int64_t> first(const Values&... values) {
    std::optional<std::int64_t> out;
    if (bind(values...).step()) out = integer(0);
    finish();
    return out;
  }

  virtual bool changes_nothing() const = 0;
  virtual int columns() const = 0;
  virtual std::string name(int column) const = 0;
  // Of the current row.
  virtual SqlKind kind(int column) const = 0;
  bool is_null(int column) const { return kind(column) == SqlKind::null; }
  virtual double number(int column) const = 0;  ///< 0 for null
  virtual std::int64_t integer(int column) const = 0;
  std::string text(int column) const;  ///< bytes as hexadecimal digits
  /// Until the next bytes() or step().
  virtual std::span<const std::byte> bytes(int column) const = 0;

 protected:
  /// Ready for step() with these parameters, which it does not need any more afterwards.
  virtual void start(std::span<const SqlValue> parameters) = 0;
  virtual void run_with(std::span<const SqlValue> parameters) = 0;
  /// Gives up the rows that were not read.
  virtual void finish() = 0;
  virtual std::string text_of(int column) const = 0;  ///< not of bytes

 private:
  static SqlValue sql_value(std::int64_t value) { return value; }
  static SqlValue sql_value(int value) { return std::int64_t{value}; }
  static SqlValue sql_value(std::size_t value) { return static_cast<std::int64_t>(value); }
  static SqlValue sql_value(double value);
  static SqlValue sql_value(const std::string& value) { return std::string_view(value); }
  static SqlValue sql_value(const std::vector<std::complex<float>>& value);  ///< null if empty
  template <typename Value>
  static SqlValue sql_value(const std::optional<Value>& value) {
    return value ? sql_value(*value) : SqlValue();
  }
};

enum class DatabaseAccess : unsigned char { read, write, create };

/// A SQLite file in WAL mode, or a PostgreSQL database. One transaction writes at a time, and readers do not wait for
/// it; others wait up to a minute. Objects of this file are used by one thread. @throws as open_database()
class Database {
 public:
  explicit Database(std::string name) : name_(std::move(name)) {}
  Database(Database&&) = delete;
  virtual ~Database() = default;

  /// See shown_place().
  const std::string& name() const noexcept { return name_; }
  /// @throws std::invalid_argument if it is not one statement
  virtual std::unique_ptr<Statement> prepare(const std::string& sql) = 0;
  virtual void execute(const std::string& sql) = 0;  ///< one or several statements
  /// Executes CREATE statements in the words of SQLite.
  virtual void create(std::string_view schema) = 0;
  virtual std::vector<std::string> tables() = 0;  ///< and views, in the order of their names
  /// Claims a number until release(), or until this process ends in any way. @returns false if another one has it
  virtual bool claim(std::int64_t number) = 0;
  virtual void release(std::int64_t number) = 0;
  /// For Transaction: begins one and waits until it is the only one that writes.
  virtual void begin() = 0;

 private:
  std::string name_;
};

/// @param place a file, or a URL as of is_database_url()
/// @throws FileError, FormatError naming the place
std::unique_ptr<Database> open_database(const std::filesystem::path& place, DatabaseAccess access);
std::unique_ptr<Database> open_sqlite(const std::filesystem::path& file, DatabaseAccess access);
std::unique_ptr<Database> open_postgres(const std::string& url, DatabaseAccess access);

/// postgresql://USER@HOST:PORT/DATABASE?OPTIONS, as libpq takes it.
bool is_database_url(const std::filesystem::path& place);

/// For messages: a URL is without its password.
std::string shown_place(const std::filesystem::path& place);

/// Everything between construction and commit() is stored, or nothing. It is the only writer meanwhile.
class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) { database_.begin(); }
  ~Transaction();
  Transaction(Transaction&&) = delete;
  void commit();

 private:
  Database& database_;
  bool open_ = true;
};

}  // namespace stageid
