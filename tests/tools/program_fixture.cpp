#include "tests/tools/program_fixture.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace stageid::test {
namespace {

const std::filesystem::path kConfigs = std::filesystem::path(STAGEID_SOURCE_DIR) / "configs";

}  // namespace

testing::AssertionResult same_bytes(const std::string& a, const std::string& b) {
  if (a == b) return testing::AssertionSuccess() << "all " << a.size() << " bytes are the same";
  const auto parted = std::mismatch(a.begin(), a.end(), b.begin(), b.end());
  return testing::AssertionFailure()
         << a.size() << " and " << b.size() << " bytes, different from byte "
         << parted.first - a.begin() << " on";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos)
    throw std::invalid_argument(fmt::format("'{}' is not in the text", from));
  return text.replace(at, from.size(), to);
}

std::map<std::string, std::string> snapshot(const std::filesystem::path& directory) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory))
    files[entry.path().string()] = entry.is_regular_file() ? read_bytes(entry.path()) : "";
  return files;
}

ProgramTest::ProgramTest() {
  write_bytes(at("small_stage.yaml"), read_bytes(kConfigs / "stage/small_stage.yaml"));
  config_ = name("experiment.yaml");
  write_bytes(config_, replaced(read_bytes(kConfigs / "experiment/small_stage.yaml"),
                                "../stage/small_stage.yaml", "small_stage.yaml"));
}

ProgramResult ProgramTest::run(const std::string& line, ProgramOptions options) const {
  if (options.working_directory.empty()) options.working_directory = directory_.path();
  std::istringstream words(line);
  return run_program(STAGEID_PROGRAM, {std::istream_iterator<std::string>(words), {}}, options);
}

ProgramResult ProgramTest::succeed(const std::string& line) const { return ends(line, 0); }

ProgramResult ProgramTest::ends(const std::string& line, int exit_code, const std::string& text,
                                ProgramOptions options) const {
  SCOPED_TRACE(line);
  const ProgramResult result = run(line, options);
  EXPECT_EQ(result.exit_code, exit_code) << result.err << result.out;
  EXPECT_THAT(result.err, testing::HasSubstr(text));
  return result;
}

nlohmann::json ProgramTest::tell(const std::string& line, int exit_code) const {
  return nlohmann::json::parse(ends(line + " --json", exit_code).out);
}

void ProgramTest::fail(const std::string& line, int exit_code, const std::string& text,
                       ProgramOptions options) const {
  SCOPED_TRACE(line);
  const auto before = snapshot(directory_.path());
  const ProgramResult result = run(line, options);
  EXPECT_EQ(result.exit_code, exit_code);
  EXPECT_THAT(result.err, testing::MatchesRegex("stageid: [^\n]+\n")) << "one line, no more";
  EXPECT_THAT(result.err, testing::HasSubstr(text));
  EXPECT_EQ(result.out, "");
  const auto after = snapshot(directory_.path());
  for (const auto& [file, content] : after)
    EXPECT_TRUE(before.count(file) == 1 && before.at(file) == content)
        << file << " was left or changed";
  EXPECT_EQ(after.size(), before.size());
}

std::string ProgramTest::experiment(const std::string& file, const std::string& from,
                                    const std::string& to) const {
  write_bytes(at(file), replaced(read_bytes(config_), from, to));
  return name(file);
}

std::string ProgramTest::stage(const std::string& file, const std::string& from,
                               const std::string& to) const {
  write_bytes(at("stage_" + file), replaced(read_bytes(at("small_stage.yaml")), from, to));
  return experiment(file, "stage: small_stage.yaml", "stage: stage_" + file);
}

void ProgramTest::make_log() const {
  if (!std::filesystem::exists(at("run.slog"))) succeed("run " + config_ + " -o run.slog");
}

void ProgramTest::make_frf() const {
  make_log();
  if (!std::filesystem::exists(at("frf.h5"))) succeed("frf run.slog -o frf.h5 --realizations 1,2");
}

void ProgramTest::make_model() const {
  make_frf();
  if (!std::filesystem::exists(at("model.json")))
    succeed("fit frf.h5 -o model.json --band 120 800 --direct-term full");
}

}  // namespace stageid::test
