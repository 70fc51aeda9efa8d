#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

// Small problems with solutions computed by other code with 60 digits: tests/estimation/reference/make_certificates.py.

namespace stageid::test {

/// The problems of a section of certificates.json.
inline nlohmann::json certificates(const std::string& section) {
  std::ifstream file(std::filesystem::path(STAGEID_SOURCE_DIR) /
                     "tests/estimation/reference/certificates.json");
  return nlohmann::json::parse(file).at(section);
}

/// The numbers of a list of any depth, in order; complex ones are pairs.
template <typename Number>
std::vector<Number> numbers(const nlohmann::json& list) {
  constexpr bool kComplex = !std::is_same_v<Number, double>;
  std::vector<Number> out;
  for (const nlohmann::json& item : list) {
    if (item.is_number()) {
      out.emplace_back(item.get<double>());
    } else if (kComplex && item.size() == 2 && item[0].is_number()) {
      if constexpr (kComplex) out.emplace_back(item[0].get<double>(), item[1].get<double>());
    } else {
      const std::vector<Number> inner = numbers<Number>(item);
      out.insert(out.end(), inner.begin(), inner.end());
    }
  }
  return out;
}

/// A list of lists as the columns of a matrix.
template <typename Number>
Eigen::MatrixX<Number> columns(const nlohmann::json& lists) {
  const std::vector<Number> all = numbers<Number>(lists);
  const auto n = static_cast<Eigen::Index>(lists.size());
  const auto rows = static_cast<Eigen::Index>(all.size()) / n;
  return Eigen::Map<const Eigen::MatrixX<Number>>(all.data(), rows, n);
}

/// The log relative error: the smallest -log10 |q - c| / |c| of the numbers of a quantity, at most that of a rounded
/// double. @param scale replaces |c| unless empty
template <typename Number>
double log_relative_error(const std::vector<Number>& found, const std::vector<Number>& certified,
                          const std::vector<double>& scale = {}) {
  double largest = found.size() == certified.size() ? 0x1p-53 : HUGE_VAL;
  for (std::size_t i = 0; i < std::min(found.size(), certified.size()); ++i) {
    const double error =
        std::abs(found[i] - certified[i]) / (scale.empty() ? std::abs(certified[i]) : scale[i]);
    largest = std::max(largest, std::isnan(error) ? HUGE_VAL : error);
  }
  return -std::log10(largest);
}

inline std::string one_decimal(double number) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(1) << number;
  return out.str();
}

/// How a quantity is compared with its certificate.
struct Comparison {
  std::vector<double> scale = {};  ///< instead of |c|
  double limit = 16.0;             ///< digits that the method leaves
  std::string label = {};          ///< in the record, instead of the name of the quantity
};

/// Records the log relative error of a quantity and the digits that the problem permits. Expects ten digits, or one less
/// than problem and method permit: both count one rounding of each number, but results are rounded several times.
template <typename Number>
void expect_digits(const nlohmann::json& problem, const std::string& quantity,
                   const std::vector<Number>& found, const Comparison& by = {}) {
  const auto certified = numbers<Number>(problem.at("solution").at(quantity));
  const double digits = log_relative_error(found, certified, by.scale);
  const auto permitted = problem.at("digits").at(quantity).get<double>();
  const auto name = problem.at("name").get<std::string>();
  testing::Test::RecordProperty(name + "_" + (by.label.empty() ? quantity : by.label),
                                one_decimal(digits) + " of " + one_decimal(permitted));
  EXPECT_GE(digits, std::min({10.0, permitted - 1.0, by.limit - 1.0})) << name << ", " << quantity;
}

}  // namespace stageid::test
