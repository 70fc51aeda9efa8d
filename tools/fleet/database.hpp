#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace stageid {

class Database;

/// One SQL statement, prepared once and executed repeatedly.
class Statement {
 public:
  /// Fills the parameters in order and is ready for step().
  template <typename... Values>
  Statement& bind(const Values&... values) {
    restart();
    int index = 0;
    (put(++index, values), ...);
    return *this;
  }
  /// The next row; false after the last one. @throws as Database
  bool step();
  /// For a statement without rows.
  template <typename... Values>
  void run(const Values&... values) {
    bind(values...);
    while (step()) {
    }
    restart();
  }
  /// Whether there is a row.
  template <typename... Values>
  bool found(const Values&... values) {
    const bool row = bind(values...).step();
    restart();
    return row;
  }

  bool changes_nothing() const;
  int columns() const;
  std::string name(int column) const;
  bool is_null(int column) const;
  bool is_integer(int column) const;
  bool is_real(int column) const;
  double number(int column) const;  ///< 0 for null
  std::int64_t integer(int column) const;
  std::string text(int column) const;                  ///< bytes as hexadecimal digits
  std::span<const std::byte> bytes(int column) const;  ///< until the next step()

 private:
  friend class Database;
  struct Free {
    void operator()(sqlite3_stmt* statement) const noexcept;
  };
  Statement(const Database& database, sqlite3_stmt* statement)
      : database_(&database), statement_(statement) {}
  void restart();
  void put(int index, std::int64_t value);
  void put(int index, int value) { put(index, std::int64_t{value}); }
  void put(int index, std::size_t value) { put(index, static_cast<std::int64_t>(value)); }
  void put(int index, double value);  ///< null unless finite
  void put(int index, const std::string& value);
  template <typename Value>
  void put(int index, const std::optional<Value>& value) {  // null if empty
    if (value) put(index, *value);
  }
  void put(int index, const std::vector<std::complex<float>>& value);  ///< null if empty

  const Database* database_;
  std::unique_ptr<sqlite3_stmt, Free> statement_;
};

/// A SQLite file in WAL mode: one writer at a time, and readers that do not wait for it. A writer waits up to a minute
/// for another one. Objects of this file are used by one thread.
class Database {
 public:
  enum class Access : unsigned char { read, write, create };

  /// @throws FileError, FormatError naming the file; here and in all other functions
  Database(std::filesystem::path file, Access access);
  Database(const Database&) = delete;  // its statements refer to it
  Database& operator=(const Database&) = delete;

  const std::filesystem::path& file() const noexcept { return file_; }
  /// @throws std::invalid_argument if it is not one statement
  Statement prepare(const std::string& sql) const;
  void execute(const std::string& sql) const;  ///< one or several statements
  std::int64_t last_id() const;
  [[noreturn]] void fail(int code) const;

 private:
  struct Close {
    void operator()(sqlite3* database) const noexcept;
  };
  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> handle_;
};

/// Everything between construction and commit() is stored, or nothing. It is the only writer meanwhile.
class Transaction {
 public:
  explicit Transaction(const Database& database);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void commit();

 private:
  const Database& database_;
  bool open_ = true;
};

}  // namespace stageid
