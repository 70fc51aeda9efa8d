#include "tools/exchange/arrays/csv_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>

#include "acquisition/files/file_error.hpp"
#include "tools/terminal/text_lines.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

/// The separator of the fields; separators within quotes are part of a name.
char separator_of(std::string_view line) {
  std::string outside;
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') quoted = !quoted;
    if (!quoted) outside += c;
  }
  for (const char c : {'\t', ';', ','})
    if (outside.find(c) != std::string::npos) return c;
  return ' ';
}

/// A field for messages, shortened because it could be a whole line of prose.
std::string shortened(const std::string& field) {
  constexpr std::size_t kMost = 40;
  if (field.size() <= kMost) return field;
  std::size_t end = kMost - 3;
  while (end > 0 && (static_cast<unsigned char>(field[end]) & 0xC0U) == 0x80U) --end;
  return field.substr(0, end) + "...";
}

std::vector<std::string> split(const TextLines& lines, std::string_view line, char separator) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (std::size_t at = 0; at < line.size(); ++at) {
    const char c = line[at];
    const bool doubled = quoted && c == '"' && at + 1 < line.size() && line[at + 1] == '"';
    if (doubled)
      fields.back() += line[++at];
    else if (c == '"')
      quoted = !quoted;
    else if (!quoted && c == separator && (c != ' ' || !fields.back().empty()))
      fields.emplace_back();
    else if (quoted || c != separator)
      fields.back() += c;
  }
  if (quoted) lines.fail("unterminated quote; close it");
  if (separator == ' ' && fields.back().empty()) fields.pop_back();
  return fields;
}

std::optional<double> number_of(std::string field, char separator) {
  if (separator == ';') std::ranges::replace(field, ',', '.');
  return parse_number(field);
}

/// Whether all fields are numbers; if not, the line contains the names of the columns.
bool all_numbers(const std::vector<std::string>& fields, char separator) {
  return std::ranges::all_of(fields, [&](const std::string& field) {
    return trimmed(field).empty() || number_of(field, separator);
  });
}

std::vector<std::string> names_of(const TextLines& lines, const std::vector<std::string>& fields) {
  std::vector<std::string> names;
  std::set<std::string> known;
  for (const std::string& field : fields) {
    names.push_back(utf8_of_text(trimmed(field)));
    if (!names.back().empty() && !known.insert(names.back()).second)
      lines.fail("duplicate column name '{}'; rename one", names.back());
  }
  return names;
}

/// Calls use(lines, fields, separator) for every line of the table; the first one determines the separator.
template <typename Use>
void for_each_row(const std::filesystem::path& file, const Use& use) {
  TextLines lines(file);
  std::optional<char> separator;
  while (!lines.at_end()) {
    const std::string_view line = lines.next();
    if (trimmed(line).empty() || line.starts_with('#') || line.starts_with('%')) continue;
    if (!separator) separator = separator_of(line);
    use(lines, split(lines, line, *separator), *separator);
  }
}

void append_row(const TextLines& lines, const std::vector<std::string>& fields, char separator,
                std::size_t row, std::vector<std::vector<double>>& columns) {
  if (fields.size() > columns.size())
    lines.fail("got {} fields; the header has {}", fields.size(), columns.size());
  for (std::size_t c = 0; c < fields.size(); ++c) {
    if (trimmed(fields[c]).empty()) continue;
    const std::optional<double> value = number_of(fields[c], separator);
    if (!value)
      lines.fail("got '{}' in column {}; expected a finite number", shortened(fields[c]), c + 1);
    if (columns[c].size() != row)
      lines.fail("column {} continues after an empty field; fill or remove the field", c + 1);
    columns[c].push_back(*value);
  }
}

}  // namespace

ArrayList read_csv(const std::filesystem::path& file) {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;
  std::size_t row = 0;
  for_each_row(file,
               [&](const TextLines& lines, const std::vector<std::string>& fields, char separator) {
                 if (columns.empty()) {
                   columns.resize(fields.size());
                   const bool head = !all_numbers(fields, separator);
                   names = head ? names_of(lines, fields) : std::vector<std::string>(fields.size());
                   for (std::size_t c = 0; c < names.size() && !head; ++c)
                     names[c] = fmt::format("{}", c + 1);
                   if (head) return;
                 }
                 append_row(lines, fields, separator, row++, columns);
               });
  if (row == 0)
    throw FormatError(file, "",
                      columns.empty()
                          ? "contains no table; the file is empty or truncated"
                          : "contains column names but no row of numbers; the file is truncated");
  ArrayList list{file, {}};
  for (std::size_t c = 0; c < columns.size(); ++c)
    if (!names[c].empty())
      list.arrays.push_back({names[c], {columns[c].size()}, std::move(columns[c])});
  return list;
}

TextTable read_text_table(const std::filesystem::path& file) {
  TextTable table;
  for_each_row(file, [&](const TextLines& lines, std::vector<std::string> fields, char) {
    if (table.names.empty()) {
      table.names = names_of(lines, fields);
      return;
    }
    if (fields.size() != table.names.size())
      lines.fail("got {} fields; the header has {}", fields.size(), table.names.size());
    for (std::string& field : fields) field = utf8_of_text(trimmed(field));
    table.rows.push_back(std::move(fields));
    table.lines.push_back(lines.line_number());
  });
  return table;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",;\t\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace stageid
