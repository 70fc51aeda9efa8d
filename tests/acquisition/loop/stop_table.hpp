#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/process/docs_table.hpp"

// The tables of docs/stops.md, whose cells are results of tests. With the environment variable STAGEID_STOP_TABLE, the
// tests write their cells instead of comparing them.
namespace stageid::test {

/// A value with a unit is measured and may differ by 5 % or two units; a count or a word may not.
inline bool same_value(const std::string& a, const std::string& b) {
  if (a == b) return true;
  std::array<std::string, 2> units;
  std::array<double, 2> values{};
  std::istringstream(a) >> values[0] >> units[0];
  std::istringstream(b) >> values[1] >> units[1];
  return !units[0].empty() && units[0] == units[1] &&
         std::abs(values[0] - values[1]) <= 2.0 + 0.05 * std::abs(values[0]);
}

/// Compares `found` ("176 um, 650 N, 24 ms, 4, 134") with the cell of this row and column.
inline void expect_in_docs(const std::string& row, const std::string& column,
                           const std::string& found) {
  const std::string file = STAGEID_SOURCE_DIR "/docs/stops.md";
  std::ifstream in(file);
  std::vector<std::string> lines = split(std::string(std::istreambuf_iterator<char>(in), {}), "\n");
  const auto head = std::find_if(lines.begin(), lines.end(), [&](const std::string& line) {
    return line.starts_with("| fault |") && line.find("| " + column + " |") != std::string::npos;
  });
  const auto line = std::find_if(head, lines.end(), [&](const std::string& text) {
    return text.starts_with("| " + row + " |");
  });
  ASSERT_NE(line, lines.end()) << "docs/stops.md has no row '" << row << "' or column '" << column
                               << "'";
  const auto columns = split(*head, " | ");
  auto cells = split(*line, " | ");
  ASSERT_EQ(cells.size(), columns.size()) << *line;
  std::size_t at = 0;
  while (columns[at] != column && columns[at] != column + " |") ++at;
  std::string& cell = cells[at];
  const std::string end = at + 1 == cells.size() ? " |" : "";
  if (std::getenv("STAGEID_STOP_TABLE") != nullptr) {
    cell = found + end;
    *line = cells[0];
    for (std::size_t i = 1; i < cells.size(); ++i) *line += " | " + cells[i];
    std::ofstream out(file);
    for (std::size_t i = 0; i < lines.size(); ++i)
      out << lines[i] << (i + 1 < lines.size() ? "\n" : "");
    return;
  }
  const auto told = split(cell.substr(0, cell.size() - end.size()), ", ");
  const auto now = split(found, ", ");
  EXPECT_TRUE(std::equal(told.begin(), told.end(), now.begin(), now.end(), same_value))
      << "docs/stops.md, '" << row << "', '" << column << "': " << cell << ", but found " << found
      << "; STAGEID_STOP_TABLE=1 writes it";
}

}  // namespace stageid::test
