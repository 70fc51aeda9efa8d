#include "tools/workbench/workbench.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "estimation/request/request_flags.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/problem_commands.hpp"
#include "tools/terminal/json.hpp"
#include "tools/workbench/fit_details.hpp"
#include "tools/workbench/model_request.hpp"
#include "tools/workbench/warm_start.hpp"

namespace stageid {
namespace {

using namespace std::chrono_literals;

constexpr auto kBetweenCosts = 100ms;
constexpr auto kImprovement = 1s;  // of the second preview
constexpr auto kFarewell = 2s;     // for pages to read the end

ReportInput input_of(const std::vector<std::filesystem::path>& files) {
  ReportInput input = report_input(files);
  input.all_lines = true;
  if (input.frf.empty())
    fail_request("{}: contains no FRF; add the FRF to which the model is fitted",
                 files.empty() ? "open" : files.front().string());
  return input;
}

/// Without what belongs to one model only.
ReportData response_of(ReportInput input) {
  input.controller_view.clear();
  input.model_h5.clear();
  return read_report_data(input);
}

std::optional<StageConfig> stage_of(const std::filesystem::path& file) {
  return file.empty() ? std::nullopt : std::optional(load_stage_config(file));
}

/// A model, if there is one, is the first fit; weights that it names are beside the FRF.
FitState first_state(const ReportInput& input, const FrfEstimate& frf, const StageConfig* stage) {
  FitState state;
  state.what = "opened";
  state.stage = FitStage::refined;
  if (input.model.empty()) {
    state.message = "no model: add modes, or fit with automatic modes";
    return state;
  }
  auto model = std::make_shared<const AdditiveModel>(read_model(input.model));
  if (model->inputs.names != frf.inputs.names || model->outputs.names != frf.outputs.names)
    fail_request("{}: its channels are not those of {}; open a model of this response",
                 input.model.string(), input.frf.string());
  state.request = request_of(*model);
  std::filesystem::path& weights = state.request.weight_file;
  if (!weights.empty() && weights.is_relative()) weights = input.frf.parent_path() / weights;
  state.cost = model->cost_history;
  state.message = model->fit.message;
  state.details = details_of_files(input, *model, frf, stage);
  state.model = std::move(model);
  state.saved = input.model;
  return state;
}

std::string message_of(const FitState& state) {
  if (!state.details || state.details->problem.empty()) return state.message;
  return fmt::format("{}; {}", state.message, state.details->problem);
}

int modes_in(const FitState& state) {
  if (!state.model) return static_cast<int>(state.request.modes.given.size());
  return static_cast<int>(
      std::ranges::count_if(state.model->submodels, [](const Submodel& s) { return s.is_mode(); }));
}

}  // namespace

Workbench::Workbench(const WorkbenchOptions& options)
    : options_(options),
      stage_(stage_of(options.stage)),
      input_(input_of(options.inputs)),
      page_(response_of(input_)),
      fingerprint_(fingerprint_of_file(input_.frf)),
      history_(first_state(input_, page_.frf(), stage())) {
  if (options_.directory.empty()) options_.directory = input_.frf.parent_path();
  for (const std::filesystem::path& file : options_.compare)
    compared_.push_back(page_.compared(read_compared({file})));
  content_.page = page_.html();
  content_.secret = true;
  content_.act = [this](const std::string& body) { return act(body); };
  content_.abort = [this] { stopped_ = version_.load(); };
  show();
  server_ = std::make_unique<DashboardServer>(
      DashboardAddress{"127.0.0.1", options_.port, "--port"}, content_);
  thread_ = std::thread([this] { run(); });
}

Workbench::~Workbench() {
  end();
  server_.reset();
  thread_.join();
}

void Workbench::end() {
  {
    const std::lock_guard lock(mutex_);
    if (ending_) return;
    ending_ = true;
    ++version_;
    content_.state.publish(state_text());
  }
  wake_.notify_all();
  server_->finish(kFarewell);
}

std::string Workbench::command() const {
  const FitState& state = history_.current();
  Json flags = flags_of(state.request);
  if (state.request.weighting == Weighting::user)
    flags["--weighting"] = state.request.weight_file.string();
  return fit_command_line(input_.frf, state.saved.empty() ? "model.json" : state.saved, flags);
}

std::string Workbench::state_json() const {
  const std::lock_guard lock(mutex_);
  return state_text();
}

std::string Workbench::state_text() const {
  const FitState& current = history_.current();
  SortedJson json = {{"state", ending_               ? "ended"
                               : current.needs_fit() ? "fitting"
                                                     : "ready"},
                     {"index", history_.index()},
                     {"states", SortedJson::array()},
                     {"command", history_.index() == 0 && !current.model ? "" : command()},
                     {"cost", current.cost},
                     {"message", message_of(current)},
                     {"controls", controls_json(current.request)},
                     {"writable", options_.write},
                     {"directory", options_.directory.string()},
                     {"compared", SortedJson::array()},
                     {"chosen", or_null(chosen_)},
                     {"edition", edition_}};
  for (const FitState& state : history_.states())
    json["states"].push_back(
        {{"what", state.what},
         {"stage", to_string(state.stage)},
         {"modes", modes_in(state)},
         {"cost", state.model ? SortedJson(state.model->fit.cost) : SortedJson()},
         {"saved", state.saved.filename().string()}});
  for (const auto& other : compared_) json["compared"].push_back(other->result.title);
  return in_ascii(json);
}

/// Publishes the current state with its results, unless it has none yet.
void Workbench::show() {
  if (history_.current().stage != FitStage::waiting) {
    content_.response.publish(page_.results(history_.current(), compared_, chosen_));
    edition_ = content_.response.get().number;
  }
  content_.state.publish(state_text());
}

/// Another state is current: ends a running fit, and begins that of the state.
void Workbench::change() {
  ++version_;
  show();
  wake_.notify_all();
}

bool Workbench::next(Work& work) {
  std::unique_lock lock(mutex_);
  wake_.wait(lock, [&] {
    return ending_ || (version_ != work.version && history_.current().needs_fit());
  });
  if (ending_) return false;
  work = {version_, history_.current()};
  return true;
}

void Workbench::run() {
  Work work;
  while (next(work)) fit(work);
}

/// Takes over the results so far, unless another state is current by now.
void Workbench::store(const Work& work) {
  const std::lock_guard lock(mutex_);
  if (version_ != work.version) return;
  history_.current() = work.state;
  show();
}

void Workbench::fail(Work& work, const std::string& why) {
  work.state.stage = FitStage::failed;
  work.state.message = why;
  store(work);
}

void Workbench::tell_progress(const Work& work, double cost) {
  const std::lock_guard lock(mutex_);
  if (version_ != work.version) return;
  history_.current().cost.push_back(cost);
  const auto now = std::chrono::steady_clock::now();
  if (now - told_ < kBetweenCosts) return;
  told_ = now;
  content_.state.publish(state_text());
}

FitSetup Workbench::setup_of(FitRequest request) const {
  request.threads = options_.threads;
  FitSetup setup = make_fit_setup(request, page_.frf());
  setup.options.response_variance = false;
  return setup;
}

/// The second preview: what a second of iterations gives.
void Workbench::improve(const FitSetup& setup, Work& work, const std::function<bool()>& is_over) {
  const auto end = std::chrono::steady_clock::now() + kImprovement;
  work.state.model = std::make_shared<const AdditiveModel>(improved(setup, *work.state.model, [&] {
    return is_over() || std::chrono::steady_clock::now() > end;
  }));
  work.state.stage = FitStage::improved;
  store(work);
}

/// Adds the details of a fit to its state, which may not be the current one by now.
void Workbench::detail(const FitSetup& setup, const Work& work, FitResult result) {
  const auto details = details_of_fit(setup, std::move(result), page_.frf(), stage());
  const std::lock_guard lock(mutex_);
  FitState* const state = history_.of(work.state.model.get());
  if (state == nullptr) return;
  state->details = details;
  if (state == &history_.current()) show();
}

/// The second preview, then the fit of `stageid fit`, then its details.
void Workbench::fit(Work& work) {
  FitState& state = work.state;
  try {
    const FitSetup setup = setup_of(state.request);
    const auto is_over = [&] { return version_ != work.version || stopped_ == work.version; };
    if (state.stage == FitStage::linear) improve(setup, work, is_over);
    FitOptions options = setup.options;
    options.progress = [&](int, double cost) { tell_progress(work, cost); };
    options.interrupted = is_over;
    FitResult result = complete_fit(setup, options, input_.frf.filename().string(), fingerprint_);
    state.message = fmt::format("{}: {}", to_string(result.status()), result.message());
    state.cost = result.cost;
    const bool stopped = result.status() == FitStatus::interrupted;
    state.stage = stopped ? FitStage::stopped : FitStage::refined;
    // A fit that was stopped early may be worse than its preview.
    if (!stopped || !state.model || result.model.fit.cost < state.model->fit.cost)
      state.model = std::make_shared<const AdditiveModel>(result.model);
    store(work);
    if (state.stage == FitStage::refined) detail(setup, work, std::move(result));
  } catch (const std::invalid_argument& error) {
    fail(work, error.what());
  } catch (const FileError& error) {
    fail(work, error.what());
  } catch (const std::bad_alloc&) {
    fail(work, "out of memory; use fewer modes or a narrower band");
  } catch (const std::exception&) {
    fail(work, "unexpected error, a bug in stageid; report the command with its input files");
  }
}

}  // namespace stageid
