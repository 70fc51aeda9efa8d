#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "estimation/modal/modal_assurance.hpp"
#include "estimation/model/cmif.hpp"
#include "tools/exchange/uff/uff_file.hpp"

namespace stageid {

/// Modes of a model beside those of another program, from datasets 55 of a universal file.
struct ModeCorrelation {
  std::vector<std::string>
      outputs;                 ///< of the model, that the file has nodes for: the shapes' channels
  std::vector<ModeShape> own;  ///< shapes on these outputs
  std::vector<ModeShape> other;
  std::vector<ModePair> pairs;
};

/// An output named as universal files name it, "12+Z", "12-RX" or "12", is that node and direction; any other one
/// is the node of its place, counted from 1, and its first letter the direction, as our exports have it.
/// @throws FormatError if the file has no modes, or no node for any output.
ModeCorrelation correlate_modes(const AdditiveModel& model, const std::filesystem::path& file,
                                const UffContent& content);

/// The modes of datasets 55 as places to start a fit from, by frequency.
/// Those of a rigid body, at 0 Hz, are left out.
/// @throws FormatError if no mode is left.
std::vector<ModeCandidate> candidates_of(const std::filesystem::path& file,
                                         const UffContent& content);

/// A table of the pairs, and what is left over on both sides.
std::vector<std::string> correlation_lines(const ModeCorrelation& correlation);

/// {"outputs", "pairs": [{"frequency_hz", "other_frequency_hz", "damping_ratio", "other_damping_ratio", "mac"}],
///  "own_alone_hz", "other_alone_hz"}
nlohmann::ordered_json correlation_json(const ModeCorrelation& correlation);

}  // namespace stageid
