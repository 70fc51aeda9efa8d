#include "estimation/request/submodel_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>
#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

constexpr const char* kExample = "for example n=4,m=3,f=120:180,zeta=0.01";

class SubmodelParser {
 public:
  explicit SubmodelParser(std::string_view text) : text_(text) {}

  SubmodelRequest parse() {
    std::string_view rest = text_;
    do {
      const std::size_t comma = std::min(rest.find(','), rest.size());
      take(rest.substr(0, comma));
      rest.remove_prefix(std::min(comma + 1, rest.size()));
    } while (!rest.empty());
    if (!has("n") && !has("l")) fail(fmt::format("the order n is missing; {}", kExample));
    if (!has("m")) request_.shape.numerator_degree = strictly_proper_degree(request_);
    if (has("m") && request_.order_by_search) fail("m is determined by n=auto; omit m");
    if (const std::string fault = fault_of(request_); !fault.empty()) fail(fault);
    return std::move(request_);
  }

 private:
  void take(std::string_view pair) {
    const std::size_t sign = pair.find('=');
    if (sign == std::string_view::npos)
      fail(fmt::format("expected key=value, got '{}'; {}", pair, kExample));
    const std::string key(pair.substr(0, sign));
    const std::string_view value = pair.substr(sign + 1);
    if (has(key)) fail(fmt::format("duplicate key '{}'; write it once", key));
    seen_.push_back(key);
    if (key == "n" && value == "auto")
      request_.order_by_search = true;
    else if (key == "n")
      request_.shape.order = whole(key, value);
    else if (key == "m")
      request_.shape.numerator_degree = whole(key, value);
    else if (key == "l")
      request_.shape.integrators = whole(key, value);
    else if (key == "f")
      request_.frequency_hz = numbers(key, value);
    else if (key == "zeta")
      request_.damping_ratio = numbers(key, value);
    else
      fail(fmt::format("unknown key '{}'; use l, n, m, f or zeta", key));
  }

  bool has(std::string_view key) const { return std::ranges::find(seen_, key) != seen_.end(); }

  int whole(const std::string& key, std::string_view value) const {
    int number = 0;
    const auto [stop, error] = std::from_chars(value.data(), value.data() + value.size(), number);
    if (error != std::errc{} || stop != value.data() + value.size())
      fail(fmt::format("{}='{}' is not a whole number{}", key, value,
                       key == "n" ? "; write one, or auto" : "; write one"));
    return number;
  }

  std::vector<double> numbers(const std::string& key, std::string_view value) const {
    std::vector<double> out;
    std::string_view rest = value;
    do {
      const std::size_t colon = std::min(rest.find(':'), rest.size());
      const std::string_view one = rest.substr(0, colon);
      double number = 0.0;
      const auto [stop, error] = std::from_chars(one.data(), one.data() + one.size(), number);
      if (error != std::errc{} || stop != one.data() + one.size() || !std::isfinite(number))
        fail(fmt::format("{}='{}' is not a list of numbers separated by colons; {}", key, value,
                         kExample));
      out.push_back(number);
      rest.remove_prefix(std::min(colon + 1, rest.size()));
    } while (!rest.empty());
    return out;
  }

  [[noreturn]] void fail(const std::string& what) const {
    fail_request("--submodel: '{}': {}", text_, what);
  }

  std::string_view text_;
  std::vector<std::string> seen_;
  SubmodelRequest request_;
};

}  // namespace

SubmodelRequest parse_submodel(std::string_view text) { return SubmodelParser(text).parse(); }

std::string submodel_text(const SubmodelRequest& request) {
  if (request.order_by_search) return "n=auto";
  const auto [l, n, m] = request.shape;
  std::string text = fmt::format("l={},n={},m={}", l, n, m);
  if (!request.frequency_hz.empty())
    text += fmt::format(",f={}", fmt::join(request.frequency_hz, ":"));
  if (!request.damping_ratio.empty())
    text += fmt::format(",zeta={}", fmt::join(request.damping_ratio, ":"));
  return text;
}

int strictly_proper_degree(const SubmodelRequest& request) {
  return std::max(request.shape.order + request.shape.integrators - 1, 0);
}

}  // namespace stageid
