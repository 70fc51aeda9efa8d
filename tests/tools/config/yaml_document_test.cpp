#include "tools/config/yaml_document.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/files/file_error.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_yaml_document {

using testing::HasSubstr;
using testing::Not;

std::string error_of(const std::string& text) {
  return test::error_message<FormatError>([&] { YamlDocument::parse("f.yaml", text); });
}

TEST(YamlText, KnowsWhereEverythingStands) {
  const YamlDocument d = YamlDocument::parse("f.yaml", "a: 1\nlist:\n  - {x: 'y'}\n");
  const YamlNode& root = d.root();
  ASSERT_EQ(root.kind, YamlNode::Kind::map);
  ASSERT_EQ(root.entries.size(), 2U);
  EXPECT_EQ(root.entries[1].mark.line, 2);
  EXPECT_EQ(root.entries[1].mark.column, 1);
  const YamlNode& map = d.node(d.value(root, "list")->items.at(0));
  EXPECT_EQ(map.entries.at(0).mark.line, 3);
  EXPECT_EQ(map.entries.at(0).mark.column, 6);
  const YamlNode& y = d.node(map.entries.at(0).value);
  EXPECT_EQ(y.mark.column, 9);
  EXPECT_FALSE(y.plain);
  EXPECT_TRUE(d.value(root, "a")->plain);
}

TEST(YamlText, AnchorsAliasesAndMergeKeysWork) {
  const YamlDocument d =
      YamlDocument::parse("f.yaml", "base: &b {p: 1, q: 2}\nsame: *b\nmore:\n  <<: *b\n  q: 3\n");
  const YamlNode& same = *d.value(d.root(), "same");
  EXPECT_EQ(d.value(same, "p")->text, "1");
  const YamlNode& more = *d.value(d.root(), "more");
  EXPECT_EQ(more.entries.size(), 2U);
  EXPECT_EQ(d.value(more, "p")->text, "1");
  EXPECT_EQ(d.value(more, "q")->text, "3");
}

TEST(YamlText, RefusesWhatIsNotOneTextDocument) {
  EXPECT_THAT(error_of("# only a comment\n"), HasSubstr("is empty"));
  EXPECT_THAT(error_of("a: 1\n---\nb: 2\n"), HasSubstr("a second YAML document"));
  EXPECT_THAT(error_of("a: !!int 3\n"), HasSubstr("f.yaml:1:4: unsupported tag"));
  EXPECT_THAT(error_of("? [a, b]\n: 1\n"), HasSubstr("a key must be a word"));
  EXPECT_THAT(error_of("a: *missing\n"), HasSubstr("f.yaml:1:"));
}

TEST(YamlText, BinaryAndForeignEncodingsAreNamedByPlace) {
  EXPECT_EQ(error_of("a: 1\nb: \xE9t\xE9\n"),
            "f.yaml:2:4: byte 0xE9 is not UTF-8 text; save the file as UTF-8");
  EXPECT_THAT(error_of(std::string("a: \0b\n", 6)), HasSubstr("f.yaml:1:4: byte 0x00 is not text"));
  EXPECT_THAT(error_of("\xFF\xFE"
                       "a"),
              HasSubstr("f.yaml:1:1: byte 0xFF"));
  EXPECT_THAT(error_of("a: \xC0\x80\n"), HasSubstr("byte 0xC0"));          // overlong
  EXPECT_THAT(error_of("a: \xED\xA0\x80\n"), HasSubstr("byte 0xED"));      // surrogate
  EXPECT_THAT(error_of("a: \xF4\x90\x80\x80\n"), HasSubstr("byte 0xF4"));  // beyond Unicode
  EXPECT_EQ(error_of("a: \xC3\xA9\n"), "no error");
}

TEST(YamlText, HostileNestingEndsInOneLine) {
  for (const char* bracket : {"[", "{a: "}) {
    std::string text;
    for (int i = 0; i < 100000; ++i) text += bracket;
    const std::string error = error_of(text);
    EXPECT_THAT(error, HasSubstr("f.yaml:1:"));
    EXPECT_THAT(error, Not(HasSubstr("\n")));
  }
  // Every level doubles; expanded it would have 2^30 leaves.
  std::string laughs = "a0: &a0 [x, x]\n";
  for (int i = 1; i < 30; ++i) laughs += fmt::format("a{0}: &a{0} [*a{1}, *a{1}]\n", i, i - 1);
  EXPECT_EQ(error_of(laughs), "no error");
}

TEST(YamlText, AKeyThatIsMissingIsAnErrorAtItsPlace) {
  for (const char* text : {": x\n", "? \n", "a: {: 1}\n", "a:\n  : 1\n"})
    EXPECT_THAT(error_of(text), HasSubstr("a key must be a word; write 'key: value'")) << text;
  EXPECT_EQ(error_of("null: 1\n"), "f.yaml:1:1: a key must be a word; write 'key: value'");
}

TEST(YamlText, MergingIsBoundedWork) {
  std::string chain = "a0: &a0 {k0: 1}\n";
  for (int i = 1; i < 20000; ++i)
    chain += fmt::format("a{0}: &a{0} {{<<: *a{1}, k{0}: 1}}\n", i, i - 1);
  EXPECT_THAT(error_of(chain), HasSubstr("'<<' copied more than 100000 keys"));
  std::string flat;
  for (int i = 0; i < 100000; ++i) flat += fmt::format("k{}: 1\n", i);
  EXPECT_EQ(error_of(flat),
            "f.yaml:1001:1: more than 1000 keys in one map; split it or remove keys");
}

TEST(YamlText, EveryCutOfAFileIsEitherReadOrOneLine) {
  const std::string whole =
      "format: x\nlist:\n  - {name: \"a b\", p: [1, 2, 3]}\n  - {name: 'c', p: &q [4]}\nlast: *q\n";
  for (std::size_t n = 0; n <= whole.size(); ++n) {
    const std::string error = error_of(whole.substr(0, n));
    if (error != "no error") {
      EXPECT_THAT(error, testing::MatchesRegex("f\\.yaml:[0-9]+:[0-9]+: .+; .+")) << n;
      EXPECT_THAT(error, Not(HasSubstr("\n"))) << n;
    }
  }
}

TEST(YamlText, AFileThatCannotBeReadIsAFileError) {
  const test::TemporaryDirectory directory;
  EXPECT_THROW(YamlDocument::read(directory / "missing.yaml"), FileError);
  EXPECT_THROW(YamlDocument::read(directory.path()), FileError);
}

TEST(YamlText, AFileOfMoreThanAMegabyteIsRefused) {
  EXPECT_THAT(error_of(std::string((1U << 20) + 1, ' ')), HasSubstr("longer than 1 MiB"));
}

}  // namespace stageid::test_yaml_document
