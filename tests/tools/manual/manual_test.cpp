// Manual and completion of a parser made up here: what its texts hold must not become markup.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/manual/manual_pages.hpp"
#include "tools/manual/shell_completion.hpp"

namespace stageid::test_manual {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

struct Manual : testing::Test {
  Manual() {
    app_.name("prog");
    app_.footer("Exit codes: 0 done");
    CLI::App* command = app_.add_subcommand("cut", "Cuts 'it' at a\\b");
    command->add_option("-o,--output", text_, ".dot first")->required();
    command->add_option("--kind", kind_, "which")->check(CLI::IsMember({"red", "blue"}));
    command->add_option("--shape", text_,
                        "round | square_one (of both) | FILE.h5 | so many; default: 3 | 4");
    command->add_flag("--dry", dry_, "a flag");
    command->add_option("files", files_, "what is cut")->required();
  }

  CLI::App app_{"A program"};
  std::string text_, kind_ = "red";
  bool dry_ = false;
  std::vector<std::string> files_;
};

TEST_F(Manual, TheTreeIsWhatTheParserHolds) {
  const CommandTree tree = command_tree(app_);
  ASSERT_EQ(tree.commands.size(), 1U);
  const CommandTree& cut = tree.commands[0];
  EXPECT_THAT(flags_of(cut.options),
              ElementsAre("-h", "--help", "-o", "--output", "--kind", "--shape", "--dry"));
  ASSERT_EQ(cut.arguments.size(), 1U);
  EXPECT_EQ(cut.arguments[0].name, "files");
  EXPECT_TRUE(cut.arguments[0].repeats);
  EXPECT_TRUE(cut.options[1].required);
  EXPECT_THAT(cut.options[1].words, IsEmpty());
  EXPECT_THAT(cut.options[2].words, ElementsAre("red", "blue"));
  // Words only: no placeholder, no sentence, nothing behind the semicolon.
  EXPECT_THAT(cut.options[3].words, ElementsAre("round", "square_one"));
  EXPECT_EQ(cut.options[4].value, "");
}

TEST_F(Manual, TextIsNotMarkup) {
  const std::vector<ManualPage> pages = manual_pages(command_tree(app_), "1.2");
  ASSERT_EQ(pages.size(), 2U);
  EXPECT_EQ(pages[1].file, "prog-cut.1");
  const std::string& text = pages[1].text;
  EXPECT_THAT(text, HasSubstr("prog\\-cut \\- Cuts \\(aqit\\(aq at a\\eb\n"));
  EXPECT_THAT(text, HasSubstr("\n\\&.dot first (required)\n"));
  EXPECT_THAT(text, HasSubstr("[\\fIOPTIONS\\fR] \\fB\\-o\\fR \\fIWORD\\fR \\fIfiles\\fR ...\n"));
  EXPECT_THAT(text, HasSubstr(".SH EXIT STATUS\nExit codes: 0 done\n"));
}

TEST_F(Manual, CompletionKnowsTheWordsOfAFlag) {
  const std::string script = bash_completion(command_tree(app_));
  EXPECT_THAT(script, HasSubstr("' cut') path='cut' ;;"));
  EXPECT_THAT(script, HasSubstr("'cut'' --kind') words='red blue' flags='' ;;"));
}

TEST_F(Manual, ZshGetsDescriptionsAsText) {
  const std::string script = zsh_completion(command_tree(app_));
  EXPECT_THAT(script, HasSubstr("' cut') place='cut' ;;"));
  EXPECT_THAT(script, HasSubstr("'cut'' --kind') values=(red blue) ;;"));
  EXPECT_THAT(script, HasSubstr("next=('cut:Cuts '\\''it'\\'' at a\\b')"));
}

}  // namespace stageid::test_manual
