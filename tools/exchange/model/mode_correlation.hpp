#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/modal/modal_assurance.hpp"
#include "estimation/model/cmif.hpp"
#include "tools/exchange/uff/uff_file.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// Modes of a model compared with those of another program, from datasets 55 of a universal file.
struct ModeCorrelation {
  std::vector<std::string>
      outputs;                 ///< of the model, with nodes in the file: the channels of the shapes
  std::vector<ModeShape> own;  ///< shapes on these outputs
  std::vector<ModeShape> other;
  std::vector<ModePair> pairs;
};

/// An output named as in universal files ("12+Z", "12-RX" or "12") is that node and direction. Any other one is the
/// node of its index, counted from 1, and its first letter is the direction, as in our exports.
/// @throws FormatError if the file has no modes, or no node for any output.
ModeCorrelation correlate_modes(const AdditiveModel& model, const std::filesystem::path& file,
                                const UffContent& content);

/// The modes of datasets 55 as start of a fit, by frequency, without those of a rigid body at 0 Hz.
/// @throws FormatError if no mode is left.
std::vector<ModeCandidate> candidates_of(const std::filesystem::path& file,
                                         const UffContent& content);

/// A table of the pairs, and the unpaired modes of both sides.
std::vector<std::string> correlation_lines(const ModeCorrelation& correlation);

/// {"outputs", "pairs": [{"frequency_hz", "other_frequency_hz", "damping_ratio", "other_damping_ratio", "mac"}],
///  "own_alone_hz", "other_alone_hz"}
Json correlation_json(const ModeCorrelation& correlation);

}  // namespace stageid
