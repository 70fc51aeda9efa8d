#include "tools/database/database.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_database {

TEST(Database, NoMessageContainsAPassword) {
  EXPECT_EQ(shown_place("fleet:1@2.db"), "fleet:1@2.db");
  EXPECT_EQ(shown_place("postgresql://u:se?cr@t@h:1/db?sslmode=require"),
            "postgresql://u@h:1/db?sslmode=require");
  EXPECT_EQ(shown_place("postgres://h/db?user=u&password=secret&port=1"),
            "postgres://h/db?user=u&password=...&port=1");
}

TEST(Database, SeveralWritersMayCreateOneFileAtTheSameInstant) {
  const test::TemporaryDirectory directory;
  constexpr int kFiles = 200, kWriters = 4;
  std::vector<std::string> errors(kFiles * kWriters);
  for (int file = 0; file < kFiles; ++file) {
    std::vector<std::jthread> writers;
    for (int writer = 0; writer < kWriters; ++writer)
      writers.emplace_back([&, &error = errors[file * kWriters + writer]] {
        try {
          const auto database =
              open_database(directory / fmt::format("{}.db", file), DatabaseAccess::create);
          Transaction transaction(*database);
          database->execute("CREATE TABLE IF NOT EXISTS a (b)");
          transaction.commit();
        } catch (const std::exception& thrown) {
          error = thrown.what();
        }
      });
  }
  for (const std::string& error : errors) EXPECT_EQ(error, "");
}

}  // namespace stageid::test_database
