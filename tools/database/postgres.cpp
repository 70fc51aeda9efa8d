#include <fmt/format.h>
#include <fmt/ranges.h>
#include <libpq-fe.h>

#include <array>
#include <cstdlib>

#include "acquisition/files/fail.hpp"
#include "tools/database/database.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

constexpr const char* kSettings =
    "SET extra_float_digits = 1; SET bytea_output = 'hex'; "
    "SET client_encoding = 'UTF8'; SET tcp_keepalives_idle = 30; SET tcp_keepalives_interval = 10; "
    "SET tcp_keepalives_count = 3";
/// What a URL may set otherwise. A peer that vanishes without a word is noticed after a minute, and its claims end.
constexpr std::array<std::pair<const char*, const char*>, 5> kConnection = {
    {{"fallback_application_name", "stageid"},
     {"connect_timeout", "30"},
     {"keepalives_idle", "30"},
     {"keepalives_interval", "10"},
     {"keepalives_count", "3"}}};
/// The first of the two numbers of a lock; the second is that of the schema.
constexpr int kWriterLock = 0x57A6E1D;

// Types of columns, from pg_type.
constexpr Oid kBytea = 17, kInt8 = 20, kInt2 = 21, kInt4 = 23, kFloat4 = 700, kFloat8 = 701,
              kNumeric = 1700;

struct Clear {
  void operator()(PGresult* result) const noexcept { ::PQclear(result); }
};
using Result = std::unique_ptr<PGresult, Clear>;

/// Statements that a transaction sends before it reads how the first one ended. Their answers must fit in the buffers.
constexpr int kMostPending = 200;

struct Connection {
  struct Close {
    void operator()(PGconn* connection) const noexcept { ::PQfinish(connection); }
  };
  std::string name;
  std::unique_ptr<PGconn, Close> handle = {};
  long statements = 0;
  bool reads_only = false;
  int pending = 0;  ///< statements that were sent, and whose ends are not known
  std::vector<std::string> unused =
      {};  ///< prepared statements to be freed when nothing is pending

  [[noreturn]] void fail(const PGresult* result) const {
    const char* field =
        result == nullptr ? nullptr : ::PQresultErrorField(result, PG_DIAG_SQLSTATE);
    const std::string state = field == nullptr ? "" : field;
    const char* primary =
        result == nullptr ? nullptr : ::PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY);
    std::string message = primary != nullptr ? primary : ::PQerrorMessage(handle.get());
    message = message.substr(0, message.find('\n'));
    const std::string kind = state.substr(0, 2);
    if (state == "55P03") fail_busy(name);
    if (::PQstatus(handle.get()) == CONNECTION_BAD)
      fail_file(name,
                "no connection to the database: {}; check the address and the server, then run the "
                "command again",
                message);
    if (state == "42501")
      fail_file(name, "{}; ask its owner for the permission, or use a database of your own",
                message);
    // 22, 23, 42: the statement is at fault; 25: it would have changed something.
    if (kind == "22" || kind == "23" || kind == "42" || (kind == "25" && reads_only))
      fail_request("{}: {}", name, message);
    fail_file(name, "{}", message);
  }
  static bool good(const PGresult* result) {
    const ExecStatusType status = ::PQresultStatus(result);
    return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
  }
  Result checked(PGresult* raw) const {
    Result result(raw);
    if (!good(raw)) fail(raw);
    return result;
  }
  /// Reads how the pending statements ended. @returns the first that failed; null: none
  Result settled() {
    Result failed;
    if (pending == 0) return failed;
    const bool lost = ::PQpipelineSync(handle.get()) == 0;
    for (; pending > 0 && !lost; --pending)
      while (Result result{::PQgetResult(handle.get())})
        if (!failed && !good(result.get())) failed = std::move(result);
    pending = 0;
    if (lost) fail(nullptr);
    const Result end(::PQgetResult(handle.get()));
    if (::PQexitPipelineMode(handle.get()) == 0) fail(failed.get());
    free_unused();
    return failed;
  }
  void free_unused() noexcept {
    for (const std::string& statement : unused)
      const Result ignored(::PQexec(handle.get(), ("DEALLOCATE " + statement).c_str()));
    unused.clear();
  }
  void settle() {
    if (const Result failed = settled()) fail(failed.get());
  }
};

/// Parameters as libpq takes them.
struct Parameters {
  explicit Parameters(std::span<const SqlValue> all)
      : texts(all.size()),
        values(all.size(), nullptr),
        sizes(all.size(), 0),
        formats(all.size(), 0) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (const auto* bytes = std::get_if<std::span<const std::byte>>(&all[i])) {
        values[i] = reinterpret_cast<const char*>(bytes->data());
        sizes[i] = static_cast<int>(bytes->size());
        formats[i] = 1;
      } else if (all[i].index() != 0) {
        texts[i] = text_of(all[i]);
        values[i] = texts[i].c_str();
      }
    }
  }
  static std::string text_of(const SqlValue& value) {
    if (const auto* number = std::get_if<double>(&value)) return fmt::format("{}", *number);
    if (const auto* integer = std::get_if<std::int64_t>(&value)) return fmt::format("{}", *integer);
    // PostgreSQL takes well-formed UTF-8 without zeros; names of files may be anything.
    std::string text = utf8_of_text(std::get<std::string_view>(value));
    std::erase(text, '\0');
    return text;
  }
  int count() const { return static_cast<int>(values.size()); }

  std::vector<std::string> texts;
  std::vector<const char*> values;
  std::vector<int> sizes, formats;
};

/// With $1, $2, ... for every ? outside of quotes.
std::string numbered(const std::string& sql) {
  std::string out;
  int parameters = 0;
  char quote = 0;
  for (const char c : sql) {
    if (quote == 0 && c == '?') {
      out += fmt::format("${}", ++parameters);
      continue;
    }
    if (quote == 0 && (c == '\'' || c == '"'))
      quote = c;
    else if (c == quote)
      quote = 0;
    out += c;
  }
  return out;
}

int digit(char c) { return c <= '9' ? c - '0' : c - 'a' + 10; }

class PostgresStatement final : public Statement {
 public:
  PostgresStatement(Connection& connection, const std::string& sql)
      : connection_(connection), statement_(fmt::format("s{}", ++connection.statements)) {
    connection.settle();
    connection.checked(
        ::PQprepare(handle(), statement_.c_str(), numbered(sql).c_str(), 0, nullptr));
    described_ = connection.checked(::PQdescribePrepared(handle(), statement_.c_str()));
  }
  ~PostgresStatement() override {
    connection_.unused.push_back(statement_);
    if (connection_.pending == 0) connection_.free_unused();
  }
  PostgresStatement(PostgresStatement&&) = delete;

  void start(std::span<const SqlValue> parameters) override {
    connection_.settle();
    const Parameters all(parameters);
    rows_ = connection_.checked(::PQexecPrepared(handle(), statement_.c_str(), all.count(),
                                                 all.values.data(), all.sizes.data(),
                                                 all.formats.data(), 0));
    row_ = -1;
  }
  /// Within a transaction, without waiting for the answer of the server.
  void run_with(std::span<const SqlValue> parameters) override {
    if (connection_.pending == 0) {
      if (::PQtransactionStatus(handle()) != PQTRANS_INTRANS) return start(parameters);
      if (::PQenterPipelineMode(handle()) == 0) connection_.fail(nullptr);
    }
    const Parameters all(parameters);
    if (::PQsendQueryPrepared(handle(), statement_.c_str(), all.count(), all.values.data(),
                              all.sizes.data(), all.formats.data(), 0) == 0) {
      if (connection_.pending == 0) ::PQexitPipelineMode(handle());
      connection_.fail(nullptr);
    }
    if (++connection_.pending >= kMostPending) connection_.settle();
  }
  bool step() override {
    if (!rows_) start({});
    return ++row_ < ::PQntuples(rows_.get());
  }
  void finish() override { rows_.reset(); }
  bool changes_nothing() const override { return connection_.reads_only; }  // the server refuses
  int columns() const override { return ::PQnfields(described_.get()); }
  std::string name(int column) const override { return ::PQfname(described_.get(), column); }
  SqlKind kind(int column) const override {
    if (::PQgetisnull(rows_.get(), row_, column) != 0) return SqlKind::null;
    switch (::PQftype(rows_.get(), column)) {
      case kBytea:
        return SqlKind::bytes;
      case kInt2:
      case kInt4:
      case kInt8:
        return SqlKind::integer;
      case kFloat4:
      case kFloat8:
      case kNumeric:
        return SqlKind::real;
      default:
        return SqlKind::text;
    }
  }
  double number(int column) const override { return std::strtod(value(column), nullptr); }
  std::int64_t integer(int column) const override {
    return std::strtoll(value(column), nullptr, 10);
  }
  std::string text_of(int column) const override { return value(column); }
  std::span<const std::byte> bytes(int column) const override {
    const std::string_view hex = value(column);  // \x00ff...
    bytes_.clear();
    for (std::size_t i = 2; i + 1 < hex.size(); i += 2)
      bytes_.push_back(static_cast<std::byte>(16 * digit(hex[i]) + digit(hex[i + 1])));
    return bytes_;
  }

 private:
  PGconn* handle() const { return connection_.handle.get(); }
  const char* value(int column) const { return ::PQgetvalue(rows_.get(), row_, column); }

  Connection& connection_;
  std::string statement_;
  Result described_, rows_;
  int row_ = -1;
  mutable std::vector<std::byte> bytes_;
};

class PostgresDatabase final : public Database {
 public:
  PostgresDatabase(const std::string& url, DatabaseAccess access) : Database(shown_place(url)) {
    connection_.name = name();
    connection_.reads_only = access == DatabaseAccess::read;
    std::vector<const char*> keys, values;
    for (const auto& [key, value] : kConnection) {
      keys.push_back(key);
      values.push_back(value);
    }
    keys.insert(keys.end(), {"dbname", nullptr});
    values.insert(values.end(), {url.c_str(), nullptr});
    connection_.handle.reset(::PQconnectdbParams(keys.data(), values.data(), 1));
    ::PQsetNoticeProcessor(
        handle(), [](void*, const char*) {}, nullptr);
    if (::PQstatus(handle()) != CONNECTION_OK) connection_.fail(nullptr);
    execute(fmt::format("SET lock_timeout = '{}s'; {}", kPatience_s, kSettings));
    if (connection_.reads_only) execute("SET SESSION CHARACTERISTICS AS TRANSACTION READ ONLY");
  }

  std::unique_ptr<Statement> prepare(const std::string& sql) override {
    return std::make_unique<PostgresStatement>(connection_, sql);
  }
  void execute(const std::string& sql) override {
    const Result failed = connection_.settled();
    if (failed && sql != "ROLLBACK") connection_.fail(failed.get());
    const Result done = connection_.checked(::PQexec(handle(), sql.c_str()));
    if (sql == "COMMIT" && std::string_view(::PQcmdStatus(done.get())) != sql)
      fail_file(connection_.name, "nothing was stored; run the command again");
  }
  void create(std::string_view schema) override {
    std::string sql(schema);
    constexpr std::array<std::pair<const char*, const char*>, 6> kWords = {{
        {" INTEGER PRIMARY KEY", " BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY"},
        {" INTEGER", " BIGINT"},
        {" BLOB", " BYTEA"},
        {" TEXT", " TEXT COLLATE \"C\""},  // the order of SQLite
        {" WITHOUT ROWID", ""},
        {"CREATE VIEW IF NOT EXISTS", "CREATE OR REPLACE VIEW"},
    }};
    for (const auto& [here, there] : kWords)
      for (std::size_t at = sql.find(here); at != std::string::npos;
           at = sql.find(here, at + std::string_view(there).size()))
        sql.replace(at, std::string_view(here).size(), there);
    execute(sql);
  }
  void begin() override {
    execute("BEGIN ISOLATION LEVEL READ COMMITTED");  // it reads what was stored while it waited
    try {
      execute(
          fmt::format("SELECT pg_advisory_xact_lock({}, hashtext(current_schema()))", kWriterLock));
    } catch (...) {
      const Result ignored(::PQexec(handle(), "ROLLBACK"));
      throw;
    }
  }
  std::vector<std::string> tables() override {
    std::vector<std::string> out;
    const auto rows = prepare(
        "SELECT table_name FROM information_schema.tables WHERE table_schema = current_schema() "
        "ORDER BY table_name");
    while (rows->step()) out.push_back(rows->text(0));
    return out;
  }
  /// A lock of this session, which ends with the process.
  bool claim(std::int64_t number) override {
    connection_.settle();
    const Result row = connection_.checked(
        ::PQexec(handle(), fmt::format("SELECT pg_try_advisory_lock({})", number).c_str()));
    return std::string_view(::PQgetvalue(row.get(), 0, 0)) == "t";
  }
  void release(std::int64_t number) override {
    execute(fmt::format("SELECT pg_advisory_unlock({})", number));
  }

 private:
  PGconn* handle() const { return connection_.handle.get(); }
  Connection connection_;
};

}  // namespace

std::unique_ptr<Database> open_postgres(const std::string& url, DatabaseAccess access) {
  return std::make_unique<PostgresDatabase>(url, access);
}

}  // namespace stageid
