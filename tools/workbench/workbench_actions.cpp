// What the page may ask the workbench to do.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <memory>
#include <stdexcept>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "tools/terminal/json.hpp"
#include "tools/workbench/edit.hpp"
#include "tools/workbench/model_request.hpp"
#include "tools/workbench/warm_start.hpp"
#include "tools/workbench/workbench.hpp"

namespace stageid {
namespace {

constexpr std::size_t kLongestName = 64;

bool is_plain_name(const std::string& name) {
  const auto plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; };
  return !name.empty() && name.size() <= kLongestName && std::ranges::all_of(name, plain);
}

}  // namespace

ActionReply Workbench::act(const std::string& body) {
  const auto action = parse_json<Json>(body);
  if (!action.is_object()) return {400, "expected a JSON object"};
  const std::lock_guard lock(mutex_);
  try {
    return act_locked(action);
  } catch (const std::invalid_argument& error) {
    return {400, error.what()};
  } catch (const FileError& error) {
    return {409, error.what()};
  }
}

ActionReply Workbench::act_locked(const SortedJson& action) {
  const std::string kind = text_in(action, "kind");
  if (kind == "save") return save(text_in(action, "name"));
  if (kind == "keep") return keep();
  if (kind == "compare") return choose(action);
  if (kind == "undo" || kind == "redo" || kind == "go") {
    const double index = number_in(action, "index").value_or(-1.0);
    const bool done = kind == "undo"   ? history_.undo()
                      : kind == "redo" ? history_.redo()
                                       : index >= 0.0 && index < FitHistory::kMost &&
                                             history_.go(static_cast<std::size_t>(index));
    if (!done) return {409, fmt::format("{}: there is no such fit", kind)};
    change();
    return {200, "done"};
  }
  history_.push(begun(edited(action, editable())));
  change();
  return {200, "done"};
}

/// The request that an edit changes: the current one, from the poles of its model.
FitRequest Workbench::editable() const {
  const FitState& state = history_.current();
  if (state.model && !state.needs_fit())
    return with_modes_of(*state.model, state.request, page_.frf().frequency_hz[0]);
  FitRequest request = state.request;
  if (request.modes.kind == ModesRequest::Kind::given) return request;
  if (state.needs_fit() && request.modes.kind != ModesRequest::Kind::none)
    fail_request("the search is not finished; wait for it, stop it, or undo");
  request.modes = {ModesRequest::Kind::none, 0, {}};
  return request;
}

/// The first answer to an edit; what cannot be fitted is refused.
FitState Workbench::begun(Edit edit) const {
  using Modes = ModesRequest::Kind;
  FitState state;
  state.what = std::move(edit.what);
  state.request = std::move(edit.request);
  const FitSetup setup = setup_of(state.request);
  if (state.request.modes.kind != Modes::given && state.request.modes.kind != Modes::none)
    return state;
  state.model =
      std::make_shared<const AdditiveModel>(warm_start(setup, history_.current().model.get()));
  state.stage = FitStage::linear;
  return state;
}

ActionReply Workbench::save(const std::string& name) {
  if (!options_.write) return {403, "the workbench is read-only; start it with --write to save"};
  FitState& state = history_.current();
  if (state.stage != FitStage::refined || !state.model)
    return {409, "there is no finished fit to save; wait for it"};
  if (!state.saved.empty()) return {409, fmt::format("already saved as {}", state.saved.string())};
  if (!is_plain_name(name))
    return {400, fmt::format("name: expected 1 to {} letters, digits, _ and -", kLongestName)};
  const std::filesystem::path file = options_.directory / (name + ".json");
  if (std::filesystem::exists(std::filesystem::symlink_status(file)))
    return {409, fmt::format("{} exists; choose another name", file.string())};
  write_model(file, *state.model);
  state.saved = file;
  show();
  return {200, file.string()};
}

ActionReply Workbench::keep() {
  const FitState& state = history_.current();
  if (!state.model) return {409, "there is no model to compare with"};
  if (compared_.size() >= kMostCompared)
    return {409, fmt::format("at most {} results can be compared", kMostCompared)};
  const std::string title = state.saved.empty()
                                ? fmt::format("fit {}: {}", history_.index() + 1, state.what)
                                : state.saved.filename().string();
  compared_.push_back(page_.compared({title, *state.model, std::nullopt}));
  show();
  return {200, title};
}

ActionReply Workbench::choose(const SortedJson& action) {
  const double index = number_in(action, "index").value_or(-1.0);
  if (index >= static_cast<double>(compared_.size()))
    return {409, "compare: there is no such result"};
  chosen_.reset();
  if (index >= 0.0) chosen_ = static_cast<std::size_t>(index);
  show();
  return {200, "done"};
}

}  // namespace stageid
