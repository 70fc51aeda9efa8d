#pragma once

#include <limits>

#include "frf/response/channel_tiles.hpp"

namespace stageid::test {

/// The data that a process of a team has; the rows of others are NaN, so that whoever reads them is found.
inline FrfEstimate divided(const FrfEstimate& whole, const Team& team) {
  constexpr double kNobody = std::numeric_limits<double>::quiet_NaN();
  FrfEstimate frf = whole;
  frf.team = &team;
  const auto [first, count] = frf.own();
  frf.response.setConstant(kNobody);
  frf.response.middleRows(first, count) = whole.response.middleRows(first, count);
  for (Eigen::MatrixXd ChannelData::*const variance :
       {&ChannelData::noise_variance, &ChannelData::total_variance}) {
    (frf.*variance).setConstant(kNobody);
    if ((frf.*variance).size() > 0)
      (frf.*variance).middleRows(first, count) = (whole.*variance).middleRows(first, count);
  }
  return frf;
}

}  // namespace stageid::test
