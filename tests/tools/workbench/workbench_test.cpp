// The workbench by its actions, on an FRF and a model that the program made. workbench_hostile_requests has requests
// without token or header.
#include "tools/workbench/workbench.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/tools/dashboard/raw_client.hpp"
#include "tests/tools/program_fixture.hpp"

namespace stageid::test_workbench {

using namespace std::chrono_literals;
using Json = nlohmann::json;
using testing::HasSubstr;

struct WorkbenchTest : test::ProgramTest {
  void open(bool write, std::vector<std::filesystem::path> inputs = {}) {
    WorkbenchOptions options;
    options.inputs = std::move(inputs);
    if (options.inputs.empty()) options.inputs = {at("frf.h5"), at("model.json")};
    options.write = write;
    bench_ = std::make_unique<Workbench>(options);
  }
  Json state() const { return Json::parse(bench_->state_json()); }
  /// After the fit.
  Json settled() const {
    for (int i = 0; i < 6000; ++i, std::this_thread::sleep_for(10ms))
      if (Json now = state(); now["state"] == "ready") return now;
    ADD_FAILURE() << "the fit does not end";
    return state();
  }
  ActionReply act(const Json& action) const { return bench_->act(action.dump()); }
  Json done(const Json& action) const {
    const ActionReply reply = act(action);
    EXPECT_EQ(reply.status, 200) << reply.text;
    return settled();
  }
  void refused(const Json& action, int status, const std::string& why) const {
    const std::size_t states = state()["states"].size();
    const ActionReply reply = act(action);
    EXPECT_EQ(reply.status, status) << action.dump();
    EXPECT_THAT(reply.text, HasSubstr(why));
    EXPECT_EQ(state()["states"].size(), states);
  }
  /// What the page fetches.
  Json results() const {
    const std::string& url = bench_->url();  // http://127.0.0.1:PORT/?token=...
    const std::string host = url.substr(7, url.find('/', 7) - 7);
    const test::RawClient client(std::stoi(host.substr(host.find(':') + 1)),
                                 "GET /response.json" + url.substr(url.find('?')) +
                                     " HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n",
                                 0, 1 << 20);
    const std::string answer = client.read_until("the end of the connection");
    return Json::parse(answer.substr(answer.find("\r\n\r\n")));
  }
  static Json current(const Json& state) {
    return state["states"][state["index"].get<std::size_t>()];
  }

  std::unique_ptr<Workbench> bench_;
};

TEST_F(WorkbenchTest, ASavedFitHasTheBytesOfItsCommandLine) {
  make_model();
  open(true);
  const int modes = current(settled())["modes"];
  EXPECT_EQ(current(done({{"kind", "remove"}, {"frequency_hz", 422.22}}))["modes"], modes - 1);
  EXPECT_EQ(
      current(done({{"kind", "add"}, {"frequency_hz", 421.0}, {"damping_ratio", 0.02}}))["modes"],
      modes);
  const Json banded = done({{"kind", "band"}, {"low_hz", 40}, {"high_hz", 700}});
  EXPECT_EQ(current(banded)["stage"], "refined");
  EXPECT_GT(banded["cost"].size(), 1U);
  const Json saved = done({{"kind", "save"}, {"name", "edited"}});
  EXPECT_EQ(current(saved)["saved"], "edited.json");
  const std::string bytes = test::read_bytes(at("edited.json"));

  const std::string command = saved["command"];
  ASSERT_THAT(command, testing::StartsWith("stageid fit "));
  const int code =
      run(test::replaced(command.substr(8), "-o " + name("edited.json"), "-o by_command.json"))
          .exit_code;
  EXPECT_TRUE(code == 0 || code == 3) << code;
  EXPECT_TRUE(test::same_bytes(bytes, test::read_bytes(at("by_command.json"))));
  refused({{"kind", "save"}, {"name", "again"}}, 409, "already saved");
}

TEST_F(WorkbenchTest, UndoAndRedoRestoreFits) {
  make_model();
  open(false);
  const Json first = settled();
  const Json second = done({{"kind", "remove"}, {"frequency_hz", 181.15}});
  EXPECT_GT(current(second)["cost"], current(first)["cost"]);
  EXPECT_NE(second["command"], first["command"]);
  EXPECT_EQ(done({{"kind", "undo"}})["command"], first["command"]);
  EXPECT_EQ(done({{"kind", "redo"}})["command"], second["command"]);
  EXPECT_EQ(done({{"kind", "go"}, {"index", 0}})["command"], first["command"]);
  refused({{"kind", "undo"}}, 409, "no such fit");
  for (const Json& index : {Json(7), Json(-1), Json(1e300), Json("0"), Json()})
    refused({{"kind", "go"}, {"index", index}}, 409, "no such fit");
}

TEST_F(WorkbenchTest, WithoutAModelItBeginsWithTheFirstMode) {
  make_frf();
  open(false, {at("frf.h5")});
  EXPECT_EQ(state()["command"], "");
  const Json one = done({{"kind", "add"}, {"frequency_hz", 181.0}});
  EXPECT_EQ(current(one)["modes"], 1);
  EXPECT_THAT(one["command"].get<std::string>(), HasSubstr("--modes 181,"));
  const Json searched = done({{"kind", "refit"}, {"modes", "auto"}});
  EXPECT_GE(current(searched)["modes"], 4);
}

TEST_F(WorkbenchTest, RefusesWhatCannotBeFittedOrRead) {
  make_model();
  open(false);
  refused({{"kind", "band"}, {"low_hz", 1e6}, {"high_hz", 2e6}}, 400, "band");
  refused({{"kind", "refit"}, {"modes", "500"}}, 400, "too many");
  refused({{"kind", "refit"}, {"rigid_body", "suspension:1e6"}}, 400, "suspension");
  for (const char* body : {"", "[]", "{", "7", "{\"kind\": {}}"})
    EXPECT_EQ(bench_->act(body).status, 400) << body;
}

TEST_F(WorkbenchTest, AnEditIsAnsweredWithItsFirstPreview) {
  make_model();
  open(false);
  const int edition = state()["edition"];
  EXPECT_EQ(act({{"kind", "remove"}, {"frequency_hz", 422.22}}).status, 200);
  const Json now = state();
  EXPECT_NE(current(now)["stage"], "waiting");
  EXPECT_FALSE(current(now)["cost"].is_null());
  EXPECT_GT(now["edition"], edition);
}

TEST_F(WorkbenchTest, ReadOnlyItWritesNothing) {
  make_model();
  const auto files = test::snapshot(at(""));
  open(false);
  done({{"kind", "remove"}, {"frequency_hz", 181.15}});
  refused({{"kind", "save"}, {"name", "x"}}, 403, "--write");
  bench_.reset();
  EXPECT_EQ(test::snapshot(at("")), files);
}

TEST_F(WorkbenchTest, SavesPlainNewNamesOnly) {
  make_model();
  open(true);
  done({{"kind", "remove"}, {"frequency_hz", 181.15}});
  const auto files = test::snapshot(at(""));
  for (const char* bad : {"", "../x", "/tmp/x", "a/b", "x.json", "a b", "..", "\xc3\xa4", "x\n"})
    refused({{"kind", "save"}, {"name", bad}}, 400, "name");
  refused({{"kind", "save"}, {"name", std::string(65, 'a')}}, 400, "name");
  refused({{"kind", "save"}, {"name", "model"}}, 409, "exists");
  EXPECT_EQ(test::snapshot(at("")), files);
}

TEST_F(WorkbenchTest, ComparesWithFitsOfTheSession) {
  make_model();
  open(false);
  settled();
  EXPECT_EQ(done({{"kind", "keep"}})["compared"].size(), 1U);
  done({{"kind", "remove"}, {"frequency_hz", 181.15}});
  const int edition = state()["edition"];
  EXPECT_EQ(done({{"kind", "compare"}, {"index", 0}})["chosen"], 0);
  EXPECT_GT(state()["edition"], edition) << "the page has to fetch the curves";
  const Json shown = results();
  ASSERT_EQ(shown["trends"].size(), 1U);
  EXPECT_EQ(shown["trends"][0]["own"].size() + 1, shown["trends"][0]["modes"].size());
  EXPECT_GE(shown["trends"][0]["pairs"].size(), 1U);
  EXPECT_TRUE(shown["blocks"].contains("model_response"));
  EXPECT_TRUE(shown["blocks"].contains("other_model"));
  EXPECT_TRUE(done({{"kind", "compare"}, {"index", nullptr}})["chosen"].is_null());
  refused({{"kind", "compare"}, {"index", 1}}, 409, "no such result");
}

TEST_F(WorkbenchTest, AFitThatIsNotShownGetsItsBandTooAndShowsItLater) {
  make_model();
  open(false);
  settled();
  const auto has_band = [&] { return results()["arrays"].contains("model_deviation"); };
  done({{"kind", "remove"}, {"frequency_hz", 181.15}});
  act({{"kind", "undo"}});  // before its band is known
  EXPECT_FALSE(has_band()) << "the opened model has none";
  std::this_thread::sleep_for(50ms);
  act({{"kind", "redo"}});
  bool found = false;
  for (int i = 0; i < 1000 && !found; ++i, std::this_thread::sleep_for(10ms)) found = has_band();
  EXPECT_TRUE(found);
}

TEST_F(WorkbenchTest, NeedsAnFrfAndAModelOfIt) {
  make_model();
  test::write_bytes(at("other.json"),
                    test::replaced(test::read_bytes(at("model.json")), "\"a1\"", "\"b1\""));
  EXPECT_THAT(
      [&] {
        open(false, {at("frf.h5"), at("other.json")});
      },
      testing::ThrowsMessage<std::invalid_argument>(HasSubstr("channels")));
  EXPECT_THAT([&] { open(false, {at("model.json")}); },
              testing::ThrowsMessage<std::invalid_argument>(HasSubstr("contains no FRF")));
}

}  // namespace stageid::test_workbench
