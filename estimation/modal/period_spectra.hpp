#pragma once

#include <Eigen/Core>

namespace stageid {

/// Spectra of one period on some lines: DFT / number of samples, unit of the channel.
struct PeriodSpectra {
  Eigen::MatrixXcd Y;  ///< outputs, n_y x N
  Eigen::MatrixXcd U;  ///< inputs, n_u x N
};

}  // namespace stageid
