#pragma once

/// The measurement loop and its logs.

#include "acquisition/formats/convert_log.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/loop/run_resident.hpp"
#include "acquisition/prediction/closed_loop_prediction.hpp"
#include "acquisition/prediction/limited_excitation.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "acquisition/record/log_reader.hpp"
#include "acquisition/slog/slog_writer.hpp"
