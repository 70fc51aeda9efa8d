#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "estimation/search/structured_fit.hpp"
#include "frf/response/distortion_variance.hpp"
#include "frf/response/frf_estimate.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// What `stageid fit` is asked, by flags or by the section `fit` of an experiment file. Empty: by
/// the FRF, see make_fit_setup().
struct FitRequest {
  std::optional<std::array<double, 2>> band_hz;
  std::string modes;                  ///< auto | none | N | f1,f2,... | FILE.json
  std::string weighting;              ///< unit | inverse_magnitude | ... | likelihood | FILE.h5
  std::string hold;                   ///< none | phase | sinc | exact
  std::string delay;                  ///< SECONDS | estimate | per_channel
  std::string rigid_body;             ///< none | full | RANK | suspension | suspension:F1:F2
  std::string residue_rank = "full";  ///< full | 1 (or another rank)
  std::string damping;                ///< proportional | general
  std::string method = "riv";         ///< riv | gn | sk
  std::string direct_term;            ///< none | full
  std::vector<SubmodelRequest>
      submodels;  ///< further ones; alone where `modes` and `rigid_body` are empty
  int max_iterations = 100;
  double search_seconds = 180.0;  ///< of an ordinary core, see SearchLimit; 0: no end
  int threads = 0;
};

/// A request put into the terms of the estimation library.
struct FitSetup {
  FrfEstimate frf;  ///< the lines of the band
  RequestedStructure structure;
  ModeSelection selection;
  FitOptions options;
  Distortion distortion;              ///< that the weights count; empty: none
  std::vector<std::string> notes;     ///< what was decided by the FRF, one line each
  std::vector<std::string> warnings;  ///< of these, what the user should do something about
  std::string request_json;           ///< the request with every default filled in: for provenance
};

/// Fills in the defaults by what the FRF holds:
///   hold zoh                        -> hold exact, delay estimated
///   delay, or delay and hold, out   -> put back into the response; hold exact, delay fixed to what
///                                      was taken out. With --hold none the response stays as it is
///   hold none                       -> no hold, delay 0
///   all outputs are accelerations   -> damping general, direct term full, no rigid body: s^2 times the
///                                      receptance of a mode is D + (B_0 + B_1 s) / A
/// Submodels that are asked for stand alone: then `modes` and `rigid_body` are none unless given, else
/// auto and full.
/// And weights: noise variance if there is one, else total variance, else relative. Of a nonlinear plant (linearity_of())
/// the total variance; with one realization, or an unknown number, of a plant whose lines scatter far more than either
/// says: that scatter, see line_scatter(), unless lines_are_coarse().
/// @throws std::invalid_argument naming the flag; FileError, FormatError for files that it names.
/// `frf` is moved where it can be: nothing else holds as much memory.
FitSetup make_fit_setup(const FitRequest& request, FrfEstimate frf);

/// Keys of the section `fit` (fit_keys.cpp).
void describe_fit_keys(ConfigVisitor& visitor, FitRequest& request);

}  // namespace stageid
