#pragma once

#include "frf/response/frf_estimate.hpp"
#include "frf/runs/health_record.hpp"

namespace stageid::test {

/// Expects the same bits in everything that a file contains.
void expect_same(const FrfEstimate& a, const FrfEstimate& b);

/// The same for the spectra of one realization.
void expect_same(const RealizationRecord& a, const RealizationRecord& b);

}  // namespace stageid::test
