#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "estimation/search/structured_fit.hpp"
#include "excitation/words/words.hpp"
#include "frf/response/distortion_variance.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The modes of a fit.
struct ModesRequest {
  enum class Kind : std::uint8_t {
    by_submodels,  ///< none if submodels are requested, else a search
    search,        ///< as many as are worth their parameters
    none,
    count,  ///< this number
    given   ///< these, with the given start values
  };
  Kind kind = Kind::by_submodels;
  int count = 0;  ///< 1 to 1000
  std::vector<ModeCandidate> given;
};

/// The term B_0 / s^2, or what replaces it.
struct RigidBodyRequest {
  enum class Kind : std::uint8_t {
    automatic,  ///< none, free or a suspension, whichever is worth its parameters
    none,
    free,         ///< B_0 / s^2; `rank` of B_0
    suspension,   ///< modes below the lowest line
    by_submodels  ///< none if submodels are requested, else automatic
  };
  Kind kind = Kind::by_submodels;
  int rank = 0;                         ///< degrees of freedom; 0: full
  std::vector<double> suspension_hz{};  ///< known frequencies; empty: fitted
};
template <>
inline constexpr std::array kWords<RigidBodyRequest::Kind> = {"auto", "none", "full", "suspension",
                                                              "by_submodels"};

struct DelayRequest {
  DelayModel model = DelayModel::fixed;
  double delay_s = 0.0;  ///< of a fixed delay
};

/// A request for a fit, as in `stageid fit`, the section `fit` of an experiment file and Python. Members that are not
/// set are chosen from the FRF, see make_fit_setup(); FitRequest{} is the default of all of them.
struct FitRequest {
  std::optional<std::array<double, 2>> band_hz{};  ///< lowest and highest line; empty: all lines
  ModesRequest modes{};
  std::optional<Weighting> weighting{};  ///< Weighting::user: weight_file
  std::filesystem::path weight_file{};   ///< HDF5 file with /weights or /weight_matrices
  std::optional<HoldModel> hold{};
  std::optional<DelayRequest> delay{};
  RigidBodyRequest rigid_body{};
  int residue_rank = 0;                   ///< of each mode; 0: full
  std::optional<bool> general_damping{};  ///< numerators B_0 + B_1 s instead of B_0
  std::optional<bool> direct_term{};      ///< a constant: the compliance of modes above the band
  FitMethod method = FitMethod::riv;
  std::vector<SubmodelRequest> submodels{};
  int max_iterations = 100;       ///< per fit
  double search_seconds = 180.0;  ///< of a typical core, see SearchLimit; 0: unlimited
  int threads = 0;                ///< 0: all cores; the result does not depend on it
};

/// A request converted to the options of structured_fit().
struct FitSetup {
  FrfEstimate frf;  ///< the lines of the band
  RequestedStructure structure;
  ModeSelection selection;
  FitOptions options;
  Distortion distortion;              ///< included in the weights; empty: none
  std::vector<std::string> notes;     ///< decisions based on the FRF, one line each
  std::vector<std::string> warnings;  ///< the decisions on which the user should act
  std::string request_json;           ///< the request with all defaults, for provenance
};

/// Fills in the defaults from the FRF:
///   hold zoh                       -> hold exact, delay estimated
///   delay, or delay and hold, removed
///                                  -> restored in the response; hold exact, delay fixed to the removed one.
///                                     With hold none the response is not changed
///   hold none                      -> no hold, delay 0
///   structure not set              -> a search for modes also chooses damping, direct term, rigid body and delays
///   all outputs are accelerations  -> general damping, direct term, no rigid body: s^2 times the receptance of a
///                                     mode is D + (B_0 + B_1 s) / A
/// Weights: noise variance if known, else total variance, else relative. The total variance for a nonlinear plant
/// (linearity_of()). With one realization, or an unknown number, of a plant whose lines scatter far more than the
/// variances allow: that scatter, see line_scatter(), unless lines_are_coarse().
/// @param frf moved if possible, because it is the largest object
/// @throws std::invalid_argument naming the request's member; FileError, FormatError for the weight file
FitSetup make_fit_setup(const FitRequest& request, FrfEstimate frf);

/// Fits the additive model P(s) = sum of modes and rigid body to an FRF, with the defaults of `stageid fit`.
/// A fit that did not converge or does not explain the data is a result: check FitResult::trustworthy().
/// Source: docs/theory.md, sections 5 to 10.
/// @throws what make_fit_setup() and structured_fit() throw
FitResult fit_model(FrfEstimate frf, const FitRequest& request = {});
/// The same with a setup that is made.
/// @param options those of the setup, with callbacks of the caller
FitResult fit_model(const FitSetup& setup, const FitOptions& options);

}  // namespace stageid
