#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/judgement/judgement_trouble.hpp"

namespace stageid::test {

/// One stage with one trouble: measures it, runs `frf`, `fit` and `validate` of the program on the log with default
/// settings, the last realization held back, and compares the model with the exact plant. Processor time is that of
/// the program alone.
///
/// Keys: seed, trouble, variant, stage, exit (the largest of the exit codes `exits`), said (the first cause: a
/// finding's, or the sentence of the verdict), right (whether `said` names what was planted), findings, message,
/// true_modes, found, extra, df, dz (errors of found modes in reported standard deviations), relative_error,
/// excess (squared error of the model over that of the measured response: p / 2n_data expected of an efficient fit),
/// delay_deviation (error of the delay in reported standard deviations),
/// dropped, periods, seconds.
nlohmann::ordered_json judge_case(std::uint64_t seed, Trouble trouble,
                                  const std::filesystem::path& program,
                                  const std::filesystem::path& keep = {});

/// Exit code 0 with a model that is wrong: farther from the plant than the measured response itself, or half of at
/// least four intervals do not hold.
bool is_garbage(const nlohmann::ordered_json& result);

}  // namespace stageid::test
