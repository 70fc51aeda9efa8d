#pragma once

#include <string>
#include <vector>

#include "estimation/request/fit_request.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// The flags of `stageid fit` with text values; empty: not given.
struct FitWords {
  std::string modes;                  ///< auto | none | N | f1,f2:zeta2,... | FILE.json
  std::string weighting;              ///< unit | inverse_magnitude | ... | likelihood | FILE.h5
  std::string hold;                   ///< none | phase | sinc | exact
  std::string delay;                  ///< SECONDS | estimate | per_channel
  std::string rigid_body;             ///< auto | none | full | RANK | suspension | suspension:F1:F2
  std::string residue_rank = "full";  ///< full | RANK
  std::string damping;                ///< proportional | general
  std::string method = "riv";         ///< riv | gn | sk
  std::string direct_term;            ///< none | full
  std::vector<std::string> submodels;  ///< see parse_submodel()
};

/// Parses the flags into `request`; other members remain unchanged.
/// @throws std::invalid_argument naming the flag; FileError, FormatError for a file of modes
void parse_fit_words(const FitWords& flags, FitRequest& request);

/// Keys of the section `fit` (fit_keys.cpp).
void describe_fit_keys(ConfigVisitor& visitor, FitRequest& request);

}  // namespace stageid
