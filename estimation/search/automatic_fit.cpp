#include "estimation/search/automatic_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "estimation/problem/fit_start.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/search/hidden_modes.hpp"
#include "estimation/search/mode_worth.hpp"
#include "estimation/search/overlapping_modes.hpp"
#include "estimation/search/proposed_modes.hpp"
#include "estimation/search/ranked_fit.hpp"
#include "estimation/search/residue_ranks.hpp"
#include "estimation/search/search_advice.hpp"
#include "estimation/search/search_constants.hpp"
#include "estimation/search/structure_moves.hpp"
#include "estimation/search/trials.hpp"
#include "estimation/start/pole_relocation.hpp"

namespace stageid {
namespace {

/// Grows and prunes a model, and records every decision.
class AutomaticFit {
 public:
  AutomaticFit(const FrfEstimate& frf, const ModelStructure& structure,
               const ModeSelection& selection, const FitOptions& options)
      : frf_(frf),
        structure_(structure),
        selection_(selection),
        options_(options),
        quick_(trial_options(frf, options)),
        worth_(frf, structure, quick_.user_weights),
        target_(selection.exactly) {
    quick_.deviation_tolerance = worth_.deviation_tolerance();
  }

  /// The first fit of every search. A search for the number of modes begins on a part of the data; a requested number
  /// is placed at once.
  void begin() {
    if (is_placed()) return begin_relocated();
    const AdditiveModel model = start();
    if (selection_.exactly > 0 || selection_.keep_modes)
      adopt(fit_additive_model(frf_, model, quick_));
    else if (!begin_on_part(model))
      begin_relocated_from(model);
  }

  /// Whether modes may be misplaced: the residual still shows one.
  bool may_exchange() {
    return selection_.exactly > 0 && !selection_.keep_modes &&
           selection_.exactly < affordable_modes() && best_.status() != FitStatus::singular &&
           !at_rounding() && !limit_reached() && missing_mode();
  }

  /// @param surplus modes to grow beyond the requested number
  void search(int surplus) {
    target_ = selection_.exactly + surplus;
    if (surplus > 0) target_ = std::min(target_, affordable_modes());
    if (best_.status() == FitStatus::singular || selection_.keep_modes) return;
    if (!delay_denied_.empty()) return;
    // Two modes on one peak prevent convergence, and their residual looks like more modes.
    if (selection_.exactly == 0) {
      reduce();
      if (!simple_) simple_ = best_;
      if (!misses_mode_beside_lines() && restructure()) reduce();
    }
    grow();
    if (surplus > 0) restructure();
    reduce();
    if (selection_.exactly == 0) {
      for (bool changed = restructure(); grow() || changed; changed = restructure()) reduce();
      a_delay_explains_more();
      return;
    }
    if (!at_rounding()) hold_hidden();
    restructure();
    if (!at_rounding()) {  // else the last fit is sufficient
      FitOptions last = quick_;
      last.max_iterations = options_.max_iterations;
      last.deviation_tolerance = settled();
      adopt(fit_additive_model(frf_, best_.model, last));
    }
    say("{}, reached by way of {}: cost {:.6g}", counted(count_modes(best_.model), "mode"), target_,
        cost());
  }

  /// Decides between general and proportional damping. A model with general damping can describe what a few missing
  /// modes, or delays, cause, and then these are not found. So the search continues with proportional damping as long as
  /// its model may become the better one. A requested number leaves no room for further modes.
  static void settle_damping(std::optional<AutomaticFit>& search) {
    if (!search->structure_.open.general_damping || !search->structure_.general_damping ||
        search->selection_.exactly > 0)
      return;
    search->structure_.open.general_damping = false;
    AutomaticFit other = *search;
    const StructureMove proportional = proportional_damping(other.quick_, other.best_.model);
    other.say("{} once more", proportional.flag);
    other.adopt(fit_additive_model(other.frf_, proportional.model, other.quick_));
    if (other.proportional_.model.fit.cost < other.cost())
      other.adopt(FitResult(other.proportional_));
    other.take_structure_of(other.best_.model);
    other.race_ = {&search->best_, other.cost(), other.best_.parameters};
    other.search(0);
    other.race_.reset();
    if (other.worth_.criterion_of_structure(other.frf_, other.best_) <
        other.worth_.criterion_of_structure(other.frf_, search->best_))
      search.emplace(std::move(other));
  }

  double score() const { return worth_.criterion(best_); }
  /// Whether the score is lower by what one mode costs.
  bool is_clearly_below(double score_before) const {
    return score() < score_before - worth_.cost_of_one();
  }

  FitResult finish(FitEvidence& evidence) {
    quick_.user_weights = {};  // the last fit computes its own
    sort_modes(best_);
    const bool cut_short = limit_reached();
    options_.limit->begin_completion();
    FitOptions last = options_;
    last.judge_modes = selection_.keep_modes;
    last.shrink_hidden = hidden_ > 0;
    if (hidden_ > 0) last.deviation_tolerance = std::max(last.deviation_tolerance, settled());
    evidence.number = mode_number();
    FitResult result = ranked_fit(frf_, best_.model, last, evidence);
    if (const std::string ranks = describe(result.residue_ranks); !ranks.empty())
      result.decisions.push_back(ranks);
    sort_modes(result);
    if (selection_.exactly > 0 && options_.residue_rank == 0 && result.trustworthy() &&
        supports_all_modes(frf_, evidence, result))
      evidence.alike = alike_modes(frf_, last, result);
    evidence.delay_denied = delay_denied_;
    if (cut_short) evidence.limit = limit_reason(frf_, options_, result);
    decisions_.insert(decisions_.end(), result.decisions.begin(), result.decisions.end());
    result.decisions = std::move(decisions_);
    result.cost.insert(result.cost.begin(), history_.begin(), history_.end());
    result.model.cost_history = result.cost;
    result.model.fit.iterations = static_cast<int>(result.cost.size()) - 1;
    return result;
  }

 private:
  double cost() const { return best_.model.fit.cost; }
  bool at_rounding() const { return worth_.at_rounding(best_); }
  bool limit_reached() const { return options_.limit->reached(); }

  /// Whether a fit has a better score than the model.
  bool is_better(const FitResult& fit) const {
    return fit.status() != FitStatus::singular && worth_.criterion(fit) < score();
  }

  /// The largest modes in the residual.
  const std::vector<ProposedMode>& proposals() {
    if (std::exchange(proposed_at_, history_.size()) != history_.size())
      proposals_ = proposed_modes(frf_, best_.model, quick_.user_weights, added_together(),
                                  quick_.workers());
    return proposals_;
  }

  /// The largest mode in the residual, if it may be worth its parameters.
  std::optional<ModeCandidate> missing_mode() {
    const std::vector<ProposedMode>& missed = proposals();
    if (missed.empty() || kReach * missed.front().gain <= worth_.price(best_)) return std::nullopt;
    return missed.front().mode;
  }

  /// Whether that mode is beside the lines. Every structure imitates such modes, so they are added first.
  bool misses_mode_beside_lines() {
    const std::optional<ModeCandidate> mode = missing_mode();
    return mode && side_of_lines(frf_, mode->frequency_hz) != 0;
  }

  ModeNumber mode_number() const {
    if (selection_.keep_modes) return ModeNumber::given;
    return selection_.exactly > 0 ? ModeNumber::asked : ModeNumber::chosen;
  }

  /// Whether only the number of modes is requested.
  bool is_placed() const {
    return selection_.exactly > 0 && selection_.modes.empty() && !selection_.keep_modes;
  }

  void begin_relocated() {
    // Pole relocation needs the delay.
    if (options_.delay != DelayModel::fixed) adopt(fit_additive_model(frf_, start(), quick_));
    AdditiveModel model = start_of({});
    const auto wanted = static_cast<std::size_t>(selection_.exactly);
    const std::vector<ModeCandidate> modes =
        relocate_poles(frf_, model, quick_.user_weights, wanted, quick_.workers());
    say("start: {} by pole relocation", counted(modes.size(), "mode"));
    FitOptions still = quick_;
    still.max_iterations = 0;
    adopt(fit_additive_model(frf_, start_of(modes), still));
    settle();
  }

  /// Newton decrement at which every free pole is within kSettled of its standard deviation.
  double settled() const {
    double free = 0.0;
    for (const Submodel& s : best_.model.submodels)
      if (is_searched_mode(s) && s.held == HeldPole::none) free += 2.0;
    return kSettled * std::sqrt(free);
  }

  /// The first fit of an open search; then all modes are placed at once by pole relocation, if that is better.
  void begin_relocated_from(const AdditiveModel& model) {
    start_ = model;
    adopt(fit_additive_model(frf_, model, quick_));
    if (limit_reached()) return;
    const auto modes = static_cast<std::size_t>(count_modes(best_.model));
    const AdditiveModel relocated =
        start_of(relocate_poles(frf_, best_.model, quick_.user_weights, modes, quick_.workers()));
    FitResult fit = fit_additive_model(frf_, relocated, quick_);
    if (!is_better(fit)) return;
    say("pole relocation: cost {:.6g} -> {:.6g}", cost(), fit.model.fit.cost);
    adopt(std::move(fit));
  }

  /// The whole search on a part of the data; then a fit of its result to all data.
  /// @returns false if the data are too few for a part
  bool begin_on_part(const AdditiveModel& model) {
    const PartOfData part = part_of_data(frf_, quick_, model);
    if (part.all) return false;
    ModelStructure structure = structure_;
    structure.given = structure_of(part.model).given;
    std::optional<AutomaticFit> search(std::in_place, part.frf, structure, selection_,
                                       part.options);
    search->begin_relocated_from(part.model);
    search->search(0);
    settle_damping(search);
    if (search->best_.status() == FitStatus::singular) return false;
    for (const std::string& decision : search->decisions_)
      say("{} of {} lines: {}", part.frf.lines(), frf_.lines(), decision);
    quick_.delay = options_.delay = search->options_.delay;
    quick_.delay_s = options_.delay_s = search->options_.delay_s;
    structure_.open = search->structure_.open;
    take_structure_of(search->best_.model);
    delay_denied_ = std::move(search->delay_denied_);
    adopt(fit_additive_model(frf_, with_all_channels(frf_, search->best_.model), quick_));
    return true;
  }

  /// Fits with all poles free as long as that halves the cost: those of modes hidden by noise never settle.
  void settle() {
    FitOptions while_free = quick_;
    while_free.max_iterations = std::min(kIterationsWhileFree, options_.max_iterations);
    for (double before = HUGE_VAL; cost() < 0.5 * before && !at_rounding() && !limit_reached();) {
      before = cost();
      FitResult free = fit_additive_model(frf_, best_.model, while_free);
      if (free.status() == FitStatus::singular) return;
      adopt(std::move(free));
    }
  }

  void hold_hidden() {
    hidden_ = hold_hidden_modes(frf_, quick_.user_weights, quick_.threads, best_);
    if (hidden_ > 0)
      say("noise hides {} of {}; their poles are held", hidden_,
          counted(count_modes(best_.model), "mode"));
  }

  AdditiveModel start() {
    std::vector<ModeCandidate> modes = selection_.modes;
    if (modes.empty() && !selection_.keep_modes) {
      modes = without_given(
          guess_from(frf_, [](const FrfEstimate& frf) { return pick_modes(frf); }), structure_);
      const std::size_t most = static_cast<std::size_t>(affordable_modes());
      if (modes.size() > most) modes.resize(most);
      say("start: {} of the CMIF", counted(modes.size(), "peak"));
    } else {
      say("start: {} given", counted(modes.size(), "mode"));
    }
    AdditiveModel model = start_of(modes);
    if (model.submodels.empty()) {
      Eigen::Index k = 0;
      guess_from(frf_, [](const FrfEstimate& frf) { return cmif(frf, CmifKind::accelerance); })
          .row(0)
          .maxCoeff(&k);
      model.submodels.push_back(mode_submodel(frf_, structure_, {frf_.frequency_hz[k], 0.01, 1}));
    }
    return model;
  }

  /// Hold, known delays, the submodels besides the modes, and these modes.
  AdditiveModel start_of(const std::vector<ModeCandidate>& modes) const {
    AdditiveModel model;
    model.hold = options_.hold;
    if (!best_.model.submodels.empty()) {
      model.input_delay_s = best_.model.input_delay_s;
      model.output_delay_s = best_.model.output_delay_s;
    } else if (options_.delay == DelayModel::fixed) {
      model.input_delay_s.setConstant(frf_.n_inputs(), options_.delay_s);
      model.output_delay_s.setZero(frf_.n_outputs());
    }
    model.submodels = fixed_submodels(frf_, structure_);
    for (const ModeCandidate& mode : modes) {
      Submodel& s = model.submodels.emplace_back(mode_submodel(frf_, structure_, mode));
      // The lines show only the asymptote of a pole an octave beside them; free, it would go to a noise peak.
      const bool is_far_beside = 2.0 * mode.frequency_hz < frf_.frequency_hz[0] ||
                                 mode.frequency_hz > 2.0 * frf_.frequency_hz[frf_.lines() - 1];
      if (selection_.keep_modes && is_far_beside) s.held = HeldPole::pole;
    }
    return model;
  }

  int affordable_modes() const { return static_cast<int>(most_modes(frf_, structure_)); }

  /// Modes to add together.
  std::size_t added_together() const {
    return std::max(kTried, static_cast<std::size_t>(count_modes(best_.model)) / kShareAtOnce);
  }

  bool wanted_more() const {
    const int modes = count_modes(best_.model);
    if (selection_.exactly > 0) return modes < target_;
    return modes < affordable_modes() && may_overtake() && !worth_.at_rounding(best_) &&
           delay_denied_.empty() && !limit_reached();
  }

  /// Changes the structure as long as that lowers the criterion, each time by the change that lowers it most.
  /// @returns true if anything was changed
  bool restructure() {
    bool changed = false;
    if (structure_.open == OpenStructure{} || history_.size() == structured_at_ ||
        !delay_denied_.empty())
      return false;
    while (!limit_reached() && may_overtake() && change_structure()) changed = true;
    structured_at_ = history_.size();
    return changed;
  }

  /// @returns false if no change is better
  bool change_structure() {
    const Sample sample(*this);
    std::vector<StructureMove> moves =
        structure_moves(sample.data.frf, sample.data.options, sample.data.model, structure_.open);
    std::erase_if(moves, [&](const StructureMove& move) {
      return count_modes(move.model) < std::min(selection_.exactly, count_modes(best_.model));
    });
    for (StructureMove& move : moves) move.flag.insert(0, "structure: ");
    if (!take_best(sample, std::move(moves))) return false;
    const bool was_proportional = !structure_.general_damping;
    take_structure_of(best_.model);
    if (was_proportional && structure_.general_damping) proportional_ = std::move(before_);
    return true;
  }

  void take_structure_of(const AdditiveModel& model) {
    const OpenStructure open = structure_.open;
    structure_ = structure_of(with_all_channels(frf_, model));
    structure_.open = open;
    worth_ = ModeWorth(frf_, structure_, quick_.user_weights);
  }

  /// Replaces two modes closer than a half-power width by one if the second is not worth its parameters.
  void merge() {
    while (!limit_reached() && history_.size() != merged_at_) {
      if (overlapping_modes(best_.model).empty()) return;
      const Sample sample(*this);
      const std::vector<StructureMove> all = merges(sample.data.options, sample.data.model);
      const std::vector<DataRange> some = ranges_of(std::ssize(all), kTried);
      if (std::none_of(some.begin(), some.end(), [&](DataRange range) {
            const auto first = all.begin() + range.first;
            return take_best(sample, {first, first + range.count});
          }))
        merged_at_ = history_.size();
    }
  }

  /// A part of the data, on which moves are tried, and the score that best_ has on all lines according to it.
  struct Sample {
    explicit Sample(const AutomaticFit& search)
        : data(part_of_data(search.frf_, search.quick_, search.best_.model)),
          worth(data.frf, search.structure_, data.options.user_weights, search.frf_.lines()) {
      FitResult fit = fit_additive_model(data.frf, data.model, data.options);
      if (!data.all && worth.at_rounding(fit) && !search.at_rounding()) {
        // Rounding decides nothing.
        data = {search.frf_, search.quick_, search.best_.model, true};
        worth = search.worth_;
        fit = fit_additive_model(data.frf, data.model, data.options);
      }
      now = worth.criterion(fit);
    }
    PartOfData data;
    ModeWorth worth;
    double now = 0.0;  ///< criterion
  };

  /// Ranks the moves by trial on the sample and takes the first that all data confirm.
  bool take_best(const Sample& sample, std::vector<StructureMove> moves) {
    struct Better {
      double criterion;
      StructureMove move;
      FitResult fit;
    };
    std::vector<Better> better;
    for (StructureMove& move : moves) {
      FitResult trial = tried(sample.data.frf, sample.worth, sample.now, move.model, move.options);
      const double then = sample.worth.criterion(trial);
      if (trial.status() == FitStatus::singular || !(then < sample.now)) continue;
      better.push_back({then, std::move(move), std::move(trial)});
    }
    std::stable_sort(better.begin(), better.end(),
                     [](const Better& a, const Better& b) { return a.criterion < b.criterion; });
    return std::any_of(better.begin(), better.end(), [&](Better& ranked) {
      return take(ranked.move, std::move(ranked.fit), sample.data.all);
    });
  }

  /// A fit that gives up early if it does not reach a criterion.
  static FitResult tried(const FrfEstimate& frf, const ModeWorth& worth, double criterion,
                         const AdditiveModel& model, FitOptions options) {
    const FitProblem problem = make_problem(frf, model, options, options.user_weights);
    options.worthwhile_cost = worth.cost_at(criterion, model, problem.parameters());
    return fit_additive_model(frf, model, options);
  }

  /// @returns false if all data do not confirm the move
  bool take(const StructureMove& move, FitResult&& fit, bool all) {
    FitOptions options = quick_;
    options.delay = move.options.delay;
    options.delay_s = move.options.delay_s;
    if (!all) fit = tried(frf_, worth_, score(), with_all_channels(frf_, fit.model), options);
    if (!is_better(fit)) return false;
    say("{}: cost {:.6g} -> {:.6g}, {} -> {} parameters", move.flag, cost(), fit.model.fit.cost,
        best_.parameters, fit.parameters);
    quick_.delay = options_.delay = options.delay;
    quick_.delay_s = options_.delay_s = options.delay_s;
    adopt(std::move(fit));
    return true;
  }

  /// Whether the model may reach the cost of its rival with as few parameters, if it gains twice as much per parameter as
  /// since the race began.
  bool may_overtake() const {
    if (!race_) return true;
    const auto left = static_cast<double>(race_->rival->parameters - best_.parameters);
    const auto used = static_cast<double>(best_.parameters - race_->parameters);
    const double gained = std::log(race_->cost / cost());
    const double behind = std::log(cost() / race_->rival->model.fit.cost);
    return left > 0.0 && behind * used <= 2.0 * gained * left;
  }

  /// Adds modes while they are worth their parameters. @returns true if any was added.
  bool grow() {
    bool grown = false;
    if (history_.size() == exhausted_at_ || !delay_denied_.empty()) return false;
    for (int round = 0; wanted_more(); ++round) {
      if (selection_.exactly == 0 && std::has_single_bit(static_cast<unsigned>(round))) {
        if (restructure()) reduce();
        if (round > 1 && a_delay_explains_more()) break;
      }
      const std::vector<ProposedMode>& candidates = proposals();
      if (!add_clear_ones(candidates) && !add_one(candidates)) break;
      grown = true;
    }
    exhausted_at_ = history_.size();
    return grown;
  }

  /// Returns to the model with which the search began if one delay, which is not to be estimated, is worth more than all
  /// that was added since: modes and general damping imitate it.
  bool a_delay_explains_more() {
    if (options_.delay != DelayModel::fixed || start_.submodels.empty() || !simple_ ||
        !(cost() < simple_->model.fit.cost))
      return false;
    FitOptions options = quick_;
    options.delay = DelayModel::estimate;
    options.delay_s = 0.0;  // 0 starts the search for a delay; a wrong value would not
    options.max_iterations = options_.max_iterations;
    AdditiveModel model = start_;  // a fit with a wrong delay has moved the poles
    model.input_delay_s.resize(0);
    model.output_delay_s.resize(0);
    const FitResult trial = fit_additive_model(frf_, model, options);
    if (!is_better(trial)) return false;
    delay_denied_ = fmt::format(
        "a delay of {:.4g} s instead of {:.4g} s fits better (squared residual {:.6g}) than more "
        "modes or another structure ({:.6g}), which were discarded; use --delay estimate",
        trial.model.mean_delay_s(), options_.delay_s, trial.model.fit.cost, cost());
    say("{}", delay_denied_);
    best_ = *simple_;
    take_structure_of(best_.model);
    return true;
  }

  /// Adds several at once if each is clearly worth it; pruning corrects surplus ones. If very many are requested,
  /// regardless of their worth.
  bool add_clear_ones(const std::vector<ProposedMode>& candidates) {
    const bool demanded = selection_.exactly > 0;
    std::vector<ProposedMode> clear;
    for (const ProposedMode& candidate : candidates)
      if (demanded || candidate.gain > 4.0 * worth_.price(best_)) clear.push_back(candidate);
    const int room =
        (selection_.exactly > 0 ? target_ : affordable_modes()) - count_modes(best_.model);
    if (room < static_cast<int>(clear.size())) clear.resize(static_cast<std::size_t>(room));
    if (clear.size() < 2) return false;
    FitResult trial = fit_with(clear);
    if (demanded ? trial.status() == FitStatus::singular : !is_worth_adding(trial)) return false;
    for (const ProposedMode& candidate : clear)
      say("added {:.6g} Hz, one of {} added together: cost {:.6g} -> {:.6g}",
          candidate.mode.frequency_hz, clear.size(), cost(), trial.model.fit.cost);
    adopt(std::move(trial));
    return true;
  }

  FitResult fit_with(const std::vector<ProposedMode>& more) const {
    AdditiveModel model = best_.model;
    for (const ProposedMode& candidate : more)
      model.submodels.push_back(mode_submodel(frf_, structure_, candidate.mode));
    return fit_additive_model(frf_, model, quick_);
  }

  /// Whether the modes that `trial` has beside those of best_ are worth their parameters, and none is fitted to one line,
  /// as outliers are: it is not narrower than the lines, and other lines than the best one confirm it.
  bool is_worth_adding(const FitResult& trial) const {
    if (!is_better(trial)) return false;
    for (std::size_t i = best_.model.submodels.size(); i < trial.model.submodels.size(); ++i)
      if (trial.model.submodels[i].damping_ratio() < kBroad &&
          mode_verdict(frf_, ModeNumber::chosen, trial, i) == ModeVerdict::at_bound)
        return false;
    const Team& team = *quick_.workers().team;
    Eigen::VectorXd gain = squares_of_lines(frf_, best_.model, quick_.user_weights, team) -
                           squares_of_lines(frf_, trial.model, quick_.user_weights, team);
    const auto added =
        static_cast<Eigen::Index>(trial.model.submodels.size() - best_.model.submodels.size());
    std::ranges::sort(gain);
    return gain.head(std::max<Eigen::Index>(0, gain.size() - added)).sum() >
           static_cast<double>(added) * worth_.most_by_chance(trial);
  }

  bool add_one(const std::vector<ProposedMode>& candidates) {
    FitResult best_trial;
    bool found = false;
    bool worth_it = false;
    const double price = worth_.price(best_);
    double reach = kReach;
    for (const ProposedMode& candidate : candidates) {
      if (selection_.exactly == 0 && reach * candidate.gain < price) continue;
      FitResult trial = fit_with({candidate});
      if (trial.status() == FitStatus::singular) continue;
      const double gain = static_cast<double>(frf_.lines()) * (cost() - trial.model.fit.cost);
      reach = 2.0 * std::max(1.0, gain / candidate.gain);  // as the last one, with a margin
      worth_it = is_worth_adding(trial);
      if (worth_it || !found || trial.model.fit.cost < best_trial.model.fit.cost)
        best_trial = std::move(trial);
      found = true;
      // The first candidate is usually right; the others are tried only if it is not worth its parameters.
      if (worth_it || limit_reached()) break;
    }
    if (!found) {
      say("no further mode: no candidate in the weighted residual justifies the parameters of a "
          "mode (BIC)");
      return false;
    }
    const Submodel& added = best_trial.model.submodels.back();
    if (selection_.exactly == 0 && !worth_it) {
      say("no further mode: the best candidate, {:.6g} Hz, would lower the cost by {:.2g} %, "
          "{}",
          added.natural_frequency_hz(), 100.0 * (1.0 - best_trial.model.fit.cost / cost()),
          is_better(best_trial) ? "but only on one line, as an outlier does"
                                : "which does not justify its parameters (BIC)");
      return false;
    }
    say("added {:.6g} Hz (damping {:.3g}): cost {:.6g} -> {:.6g}", added.natural_frequency_hz(),
        added.damping_ratio(), cost(), best_trial.model.fit.cost);
    adopt(std::move(best_trial));
    return true;
  }

  /// Drops modes that are not worth their parameters, several at a time, or one by one if that fails.
  void prune() {
    std::size_t at_once = best_.model.submodels.size();
    while (count_modes(best_.model) > 1 && at_once > 0) {
      const int surplus =
          selection_.exactly > 0 ? count_modes(best_.model) - selection_.exactly : 0;
      if (selection_.exactly > 0 && surplus <= 0) return;
      // A refit regains part of the removal cost, so the limit is twice the price here, and BIC decides afterwards.
      const double limit =
          surplus > 0 ? std::numeric_limits<double>::infinity() : 2.0 * worth_.price(best_);
      const std::size_t most =
          surplus > 0 ? std::min(at_once, static_cast<std::size_t>((surplus + 1) / 2)) : at_once;
      const std::vector<std::size_t> out = least_worthy(best_, limit, most);
      if (out.empty()) return;
      AdditiveModel model = best_.model;
      for (std::size_t n = out.size(); n-- > 0;)
        model.submodels.erase(model.submodels.begin() + static_cast<std::ptrdiff_t>(out[n]));
      FitResult without = fit_additive_model(frf_, model, quick_);
      const bool worse =
          surplus > 0 ? out.size() > 1 && !is_predicted(without, out) : !is_better(without);
      if (worse) {
        at_once = out.size() / 2;
        continue;
      }
      for (const std::size_t i : out)
        say("dropped {:.6g} Hz: cost {:.6g} -> {:.6g}",
            best_.model.submodels[i].natural_frequency_hz(), cost(), without.model.fit.cost);
      adopt(std::move(without));
      at_once *= 2;
    }
  }

  /// Whether the squares rise by no more than the removal costs of these modes together. They rise by more if two of
  /// them described the same resonance.
  bool is_predicted(const FitResult& without, const std::vector<std::size_t>& out) const {
    double predicted = 0.0;
    for (const std::size_t i : out) predicted += best_.removal_cost[i];
    const double lines = static_cast<double>(frf_.lines());
    return 2.0 * lines * (without.model.fit.cost - cost()) <= predicted;
  }

  void reduce() {
    prune();
    if (selection_.exactly == 0) merge();
  }

  /// Continues from `result`, with its iterations added to the history.
  void adopt(FitResult&& result) {
    before_ = std::exchange(best_, std::move(result));
    history_.insert(history_.end(), best_.cost.begin(), best_.cost.end());
  }

  template <typename... Args>
  void say(fmt::format_string<Args...> format, Args&&... args) {
    decisions_.push_back(fmt::format(format, std::forward<Args>(args)...));
  }

  const FrfEstimate& frf_;
  ModelStructure structure_;  ///< of best_, once it is fitted
  const ModeSelection& selection_;
  FitOptions options_;
  FitOptions quick_;
  ModeWorth worth_;
  int target_;      ///< number of modes to grow to, if it is requested
  int hidden_ = 0;  ///< modes of best_ whose poles are held because noise hides them
  /// A race with a model of another structure, from a cost and a number of parameters on.
  struct Race {
    const FitResult* rival;
    double cost;
    Eigen::Index parameters;
  };
  std::optional<Race> race_;
  std::string delay_denied_;  ///< why the search ended early; empty if it did not
  FitResult best_;
  FitResult before_;                 ///< the last one before best_ was adopted
  AdditiveModel start_;              ///< of the first fit; empty if that was of a part of the data
  std::optional<FitResult> simple_;  ///< before modes were added or the structure was changed
  FitResult proportional_;           ///< the last one before general damping
  std::vector<std::string> decisions_;
  std::vector<double> history_;
  std::vector<ProposedMode> proposals_;
  // Size of the history when modes were proposed, or no such move was left; with the same model, none is tried again.
  std::size_t proposed_at_ = 0;
  std::size_t merged_at_ = 0;
  std::size_t structured_at_ = 0;
  std::size_t exhausted_at_ = 0;  // modes to add
};

}  // namespace

FitResult automatic_fit(const FrfEstimate& frf, const ModelStructure& structure,
                        const ModeSelection& selection, const FitOptions& asked) {
  FitEvidence evidence;
  FitResult fit = searched_fit(frf, structure, selection, asked, evidence);
  judge(frf, evidence, fit);
  return fit;
}

FitResult searched_fit(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeSelection& selection, const FitOptions& asked,
                       FitEvidence& evidence) {
  check(frf);
  if (selection.exactly < 0)
    throw std::invalid_argument("fit: the number of modes must be positive");
  const Eigen::Index most = most_modes(frf, structure);
  if (selection.exactly > most || selection.modes.size() > static_cast<std::size_t>(most))
    throw std::invalid_argument(fmt::format(
        "fit: {} lines are too few for {} modes; request at most {}", frf.lines(),
        std::max<std::size_t>(static_cast<std::size_t>(selection.exactly), selection.modes.size()),
        most));
  FitOptions options = asked;
  options.limit = search_limit(selection, asked);
  std::optional<AutomaticFit> best(std::in_place, frf, structure, selection, options);
  best->begin();
  best->search(0);
  AutomaticFit::settle_damping(best);
  // Misplaced modes are exchanged: more are added at the peaks of the residual, and the least worthy are dropped.
  const int fifth = 1 + selection.exactly / static_cast<int>(kShareAtOnce);
  const int most_surplus = std::max(static_cast<int>(kTried), fifth);
  for (int surplus = fifth; surplus <= most_surplus && best->may_exchange();) {
    AutomaticFit other = *best;
    other.search(surplus);
    if (!other.is_clearly_below(best->score())) surplus *= 2;
    if (other.score() < best->score()) best.emplace(std::move(other));
  }
  return best->finish(evidence);
}

std::shared_ptr<SearchLimit> search_limit(const ModeSelection& selection,
                                          const FitOptions& options) {
  if (options.limit) return options.limit;
  const bool open = selection.exactly == 0 && !selection.keep_modes;
  return std::make_shared<SearchLimit>(open ? selection.search_seconds : 0.0, options.interrupted);
}

}  // namespace stageid
