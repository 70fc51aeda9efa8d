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
#include <vector>

#include "tools/database/database_engine.hpp"

namespace stageid {

/// One SQL statement, prepared once and executed repeatedly. Parameters are written as ?.
class Statement {
 public:
  /// Takes the parameters in order and is ready for step(). Numbers that are not finite are null.
  template <typename... Values>
  Statement& bind(const Values&... values) {
    engine_->start(std::array<SqlValue, sizeof...(Values)>{sql_value(values)...});
    return *this;
  }
  /// The next row; false after the last one. @throws as Database
  bool step() { return engine_->step(); }
  /// For a statement without rows. Within a Transaction, an error may be thrown later, at the latest by commit().
  template <typename... Values>
  void run(const Values&... values) {
    engine_->run(std::array<SqlValue, sizeof...(Values)>{sql_value(values)...});
  }
  /// The number in the first column of the first row; none if there is no row.
  template <typename... Values>
  std::optional<std::int64_t> first(const Values&... values) {
    std::optional<std::int64_t> out;
    if (bind(values...).step()) out = integer(0);
    engine_->finish();
    return out;
  }

  bool changes_nothing() const { return engine_->changes_nothing(); }
  int columns() const { return engine_->columns(); }
  std::string name(int column) const { return engine_->name(column); }
  bool is_null(int column) const { return engine_->kind(column) == SqlKind::null; }
  bool is_integer(int column) const { return engine_->kind(column) == SqlKind::integer; }
  bool is_real(int column) const { return engine_->kind(column) == SqlKind::real; }
  double number(int column) const { return engine_->number(column); }  ///< 0 for null
  std::int64_t integer(int column) const { return engine_->integer(column); }
  std::string text(int column) const;                   ///< bytes as hexadecimal digits
  std::span<const std::byte> bytes(int column) const {  ///< until the next bytes() or step()
    return engine_->bytes(column);
  }

 private:
  friend class Database;
  explicit Statement(std::unique_ptr<StatementEngine> engine) : engine_(std::move(engine)) {}

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

  std::unique_ptr<StatementEngine> engine_;
};

/// A SQLite file in WAL mode, or a PostgreSQL database. One transaction writes at a time, and readers do not wait for
/// it; others wait up to a minute. Objects of this file are used by one thread.
class Database {
 public:
  using Access = DatabaseAccess;

  /// @param place a file, or a URL as of is_database_url()
  /// @throws FileError, FormatError naming the place; here and in all other functions
  Database(const std::filesystem::path& place, Access access);
  Database(Database&&) = delete;

  /// See shown_place().
  const std::string& name() const noexcept { return name_; }
  /// @throws std::invalid_argument if it is not one statement
  Statement prepare(const std::string& sql) const { return Statement(engine_->prepare(sql)); }
  void execute(const std::string& sql) const { engine_->execute(sql); }
  /// See DatabaseEngine.
  void create(const std::string& schema) const { engine_->create(schema); }
  std::vector<std::string> tables() const { return engine_->tables(); }
  bool claim(std::int64_t number) const { return engine_->claim(number); }
  void release(std::int64_t number) const { engine_->release(number); }

 private:
  friend class Transaction;
  std::string name_;
  std::unique_ptr<DatabaseEngine> engine_;
};

/// postgresql://USER@HOST:PORT/DATABASE?OPTIONS, as libpq takes it.
bool is_database_url(const std::filesystem::path& place);

/// For messages: a URL is without its password.
std::string shown_place(const std::filesystem::path& place);

/// Everything between construction and commit() is stored, or nothing. It is the only writer meanwhile.
class Transaction {
 public:
  explicit Transaction(const Database& database);
  ~Transaction();
  Transaction(Transaction&&) = delete;
  void commit();

 private:
  const Database& database_;
  bool open_ = true;
};

}  // namespace stageid
