#include "tools/database/database.hpp"

#include <fmt/format.h>

#include <cmath>
#include <regex>

#include "acquisition/files/fail.hpp"

namespace stageid {

std::string Statement::text(int column) const {
  if (kind(column) != SqlKind::bytes) return text_of(column);
  std::string digits;
  for (const std::byte byte : bytes(column))
    digits += fmt::format("{:02x}", std::to_integer<unsigned>(byte));
  return digits;
}

SqlValue Statement::sql_value(double value) {
  return std::isfinite(value) ? SqlValue(value) : SqlValue();
}

SqlValue Statement::sql_value(const std::vector<std::complex<float>>& value) {
  return value.empty() ? SqlValue() : SqlValue(std::as_bytes(std::span(value)));
}

void fail_busy(const std::string& name) {
  fail_file(name,
            "another process has been writing for {} s; run the command again when it has ended",
            kPatience_s);
}

bool is_database_url(const std::filesystem::path& place) {
  return place.native().starts_with("postgresql://") || place.native().starts_with("postgres://");
}

std::string shown_place(const std::filesystem::path& place) {
  if (!is_database_url(place)) return place.string();
  static const std::regex of_user("(://[^/@:]*):[^/]*@");
  static const std::regex parameter("([?&]password=)[^&]*");
  const std::string url = std::regex_replace(place.string(), of_user, "$1@");
  return std::regex_replace(url, parameter, "$1...");
}

std::unique_ptr<Database> open_database(const std::filesystem::path& place, DatabaseAccess access) {
  return is_database_url(place) ? open_postgres(place.string(), access)
                                : open_sqlite(place, access);
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
