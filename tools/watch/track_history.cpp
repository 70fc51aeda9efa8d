#include "tools/watch/track_history.hpp"

#include <fmt/format.h>

#include <ranges>
#include <vector>

namespace stageid {

void TrackHistory::add(double time_s, const Eigen::VectorXd& change,
                       const Eigen::VectorXd& deviation) {
  if (added_++ % every_ != 0) return;
  rows_.push_back({time_s, change, deviation});
  if (rows_.size() < kMost) return;
  for (std::size_t k = 0; 2 * k < rows_.size(); ++k) rows_[k] = std::move(rows_[2 * k]);
  rows_.resize((rows_.size() + 1) / 2);
  every_ *= 2;
}

std::string TrackHistory::json() const {
  const auto list = [&](auto value) {
    return fmt::format("[{:.5g}]", fmt::join(rows_ | std::views::transform(value), ","));
  };
  const auto lists = [&](Eigen::VectorXd Row::*of) {
    std::vector<std::string> texts;
    for (Eigen::Index p = 0; !rows_.empty() && p < rows_[0].change.size(); ++p)
      texts.push_back(list([&](const Row& row) { return (row.*of)[p]; }));
    return fmt::format("[{}]", fmt::join(texts, ",\n"));
  };
  return fmt::format(R"({{"time_s":{},"change":{},"deviation":{}}})", list(&Row::time_s),
                     lists(&Row::change), lists(&Row::deviation));
}

}  // namespace stageid
