#include "tools/watch/track_history.hpp"

#include <fmt/format.h>

#include <iterator>

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
  std::string text;
  const auto list = [&](auto value) {
    text += '[';
    for (std::size_t k = 0; k < rows_.size(); ++k)
      fmt::format_to(std::back_inserter(text), "{}{:.5g}", k > 0 ? "," : "", value(rows_[k]));
    text += ']';
  };
  const auto lists = [&](Eigen::VectorXd Row::*of) {
    const Eigen::Index columns = rows_.empty() ? 0 : rows_[0].change.size();
    for (Eigen::Index p = 0; p < columns; ++p) {
      text += p > 0 ? ",\n" : "\n";
      list([&](const Row& row) { return (row.*of)[p]; });
    }
  };
  text = R"({"time_s":)";
  list([](const Row& row) { return row.time_s; });
  text += R"(,"change":[)";
  lists(&Row::change);
  text += R"(],"deviation":[)";
  lists(&Row::deviation);
  return text + "]}";
}

}  // namespace stageid
