#include "tools/exchange/arrays/named_array.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

#include "acquisition/files/counted.hpp"

namespace stageid {
namespace {

/// Source index of every element of the result, in C order of the result.
std::vector<std::size_t> source_places(const std::vector<std::size_t>& shape,
                                       const std::vector<std::size_t>& axes) {
  const std::size_t rank = shape.size();
  std::vector<std::size_t> stride(rank, 1);
  for (std::size_t q = rank; q-- > 1;) stride[q - 1] = stride[q] * shape[q];
  std::size_t count = 1;
  for (const std::size_t extent : shape) count *= extent;
  std::vector<std::size_t> places(count);
  std::vector<std::size_t> index(rank, 0);
  std::size_t place = 0;
  for (std::size_t& out : places) {
    out = place;
    for (std::size_t q = rank; q-- > 0;) {
      place += stride[axes[q]];
      if (++index[q] < shape[axes[q]]) break;
      place -= stride[axes[q]] * shape[axes[q]];
      index[q] = 0;
    }
  }
  return places;
}

}  // namespace

std::size_t NamedArray::size() const {
  return std::visit([](const auto& list) { return list.size(); }, values);
}

bool NamedArray::is_vector() const noexcept {
  return shape.size() <= 1 + static_cast<std::size_t>(std::ranges::count(shape, 1U));
}

const NamedArray* ArrayList::find(const std::string& name) const {
  std::string wanted = name.starts_with('/') ? name.substr(1) : name;
  const auto search = [&]() -> const NamedArray* {
    const auto found = std::ranges::find(arrays, wanted, &NamedArray::name);
    return found == arrays.end() ? nullptr : &*found;
  };
  if (const NamedArray* found = search()) return found;
  std::ranges::replace(wanted, '.', '/');
  return search();
}

const NamedArray& ArrayList::at(const std::string& name) const {
  if (const NamedArray* found = find(name)) return *found;
  for (const UnreadVariable& variable : unread)
    if (name == variable.name || name.starts_with(variable.name + ".") ||
        name.starts_with(variable.name + "/"))
      fail(variable.name, "{} cannot be read. {}", variable.what, variable.remedy);
  fail("", "has no '{}'; it contains {}", name, listed(names(), 40));
}

std::vector<std::string> ArrayList::names() const {
  std::vector<std::string> names;
  for (const NamedArray& array : arrays) names.push_back(array.name);
  return names;
}

NamedArray permuted(const NamedArray& array, const std::vector<std::size_t>& axes) {
  std::vector<std::size_t> sorted = axes;
  std::ranges::sort(sorted);  // a hostile file may have a million axes
  std::vector<std::size_t> all(array.shape.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  if (sorted != all)
    fail_request("{}: {} are not a permutation of the {} axes of the array", array.name,
                 fmt::join(axes, ", "), all.size());
  NamedArray result{array.name, {}, array.values};
  for (const std::size_t axis : axes) result.shape.push_back(array.shape[axis]);
  if (axes.size() < 2) return result;
  const std::vector<std::size_t> places = source_places(array.shape, axes);
  std::visit(
      [&](auto& to) {
        const auto& from = std::get<std::decay_t<decltype(to)>>(array.values);
        for (std::size_t k = 0; k < places.size(); ++k) to[k] = from[places[k]];
      },
      result.values);
  return result;
}

NamedArray reversed(const NamedArray& array) {
  std::vector<std::size_t> axes(array.shape.size());
  std::iota(axes.rbegin(), axes.rend(), std::size_t{0});
  return permuted(array, axes);
}

const std::vector<double>& real_values(const ArrayList& list, const NamedArray& array) {
  if (array.is_text()) list.fail(array.name, "contains text; expected numbers");
  if (array.is_complex()) list.fail(array.name, "contains complex numbers; expected real ones");
  return std::get<0>(array.values);
}

std::vector<std::complex<double>> complex_values(const ArrayList& list, const NamedArray& array) {
  if (array.is_complex()) return std::get<1>(array.values);
  const std::vector<double>& real = real_values(list, array);
  return {real.begin(), real.end()};
}

}  // namespace stageid
