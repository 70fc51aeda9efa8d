#include "tools/manual/help_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iterator>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

namespace stageid {
namespace {

using testing::HasSubstr;

std::string help_at(std::size_t width) {
  CLI::App app{"Does things", "things"};
  app.formatter(std::make_shared<HelpText>(width));
  double seconds = 3.0;
  std::string name;
  std::vector<double> limits;
  bool flag = false;
  app.add_option("input", name, "a file of things")->required();
  app.add_option("--seconds", seconds, "how long the words of this description are to be read")
      ->type_name("SECONDS")
      ->capture_default_str();
  CLI::Option* const band =
      app.add_option("--a-band-with-a-long-name", limits, "low and high")->expected(2);
  app.add_flag("-q,--quiet", flag, "no words")->needs(band);
  app.add_subcommand("sub", "a command of many words that do not fit into one line of text");
  return app.help();
}

TEST(HelpText, WrapsAtItsWidthAndNamesTheValues) {
  EXPECT_THAT(help_at(200), HasSubstr("  --seconds SECONDS           how long the words of this "
                                      "description are to be read [3]\n"));
  const std::string narrow = help_at(64);
  std::istringstream lines(narrow);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 64U) << line;
  EXPECT_THAT(narrow, HasSubstr("  input                       a file of things\n"));
  EXPECT_THAT(narrow,
              HasSubstr("\n                              description are to be read [3]\n"));
  EXPECT_THAT(narrow, HasSubstr("  --a-band-with-a-long-name NUMBER NUMBER\n"
                                "                              low "));
  EXPECT_THAT(narrow, HasSubstr("no words (only with\n"));
}

TEST(HelpText, LosesNoWord) {
  const auto words_of = [](const std::string& text) {
    std::istringstream stream(text);
    return std::vector<std::string>{std::istream_iterator<std::string>(stream), {}};
  };
  EXPECT_EQ(words_of(help_at(61)), words_of(help_at(200)));
}

}  // namespace
}  // namespace stageid
