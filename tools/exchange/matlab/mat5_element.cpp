#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>

#include "tools/exchange/arrays/raw_number.hpp"
#include "tools/exchange/matlab/mat_variable.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

static_assert(std::endian::native == std::endian::little, "the head declares little-endian data");

enum class DataType : std::uint32_t {
  int8 = 1,
  uint16 = 4,
  int32 = 5,
  uint32 = 6,
  float64 = 9,
  matrix = 14
};
enum class ArrayClass : std::uint32_t { cell = 1, structure = 2, text = 4, float64 = 6 };
constexpr std::uint32_t kComplexFlag = 0x0800;
constexpr std::size_t kAlignment = 8;

void put(std::string& out, const void* data, std::size_t bytes) {
  if (bytes > 0) out.append(static_cast<const char*>(data), bytes);
}

void put_data(std::string& out, DataType type, const void* data, std::size_t bytes) {
  const bool small = bytes > 0 && bytes <= 4;  // then it is part of the tag
  append_raw(out, static_cast<std::uint32_t>(type) |
                      (small ? static_cast<std::uint32_t>(bytes) << 16U : 0U));
  if (!small) append_raw(out, static_cast<std::uint32_t>(bytes));
  put(out, data, bytes);
  out.append((kAlignment - out.size() % kAlignment) % kAlignment, '\0');
}

/// The parts that all classes have, and `content`; elements begin at multiples of 8 bytes of `out`.
template <typename Content>
void put_matrix(std::string& out, const std::string& name, ArrayClass kind, std::uint32_t flags,
                const std::vector<std::size_t>& shape, Content content) {
  append_raw(out, static_cast<std::uint32_t>(DataType::matrix));
  const std::size_t length_at = out.size();
  append_raw(out, std::uint32_t{0});
  const std::uint32_t head[2] = {static_cast<std::uint32_t>(kind) | flags, 0};
  put_data(out, DataType::uint32, head, sizeof(head));
  const std::vector<std::int32_t> extents(shape.begin(), shape.end());
  put_data(out, DataType::int32, extents.data(), extents.size() * sizeof(std::int32_t));
  put_data(out, DataType::int8, name.data(), name.size());
  content();
  const auto length = static_cast<std::uint32_t>(out.size() - length_at - 4);
  std::memcpy(out.data() + length_at, &length, sizeof(length));
}

void put_text(std::string& out, const std::string& name, const std::string& text) {
  const std::u16string units = utf16_of(text);
  put_matrix(out, name, ArrayClass::text, 0, {units.empty() ? 0U : 1U, units.size()}, [&] {
    put_data(out, DataType::uint16, units.data(), units.size() * sizeof(char16_t));
  });
}

void put_numbers(std::string& out, const std::string& name, const NamedArray& array) {
  const NamedArray stored = as_matlab_stores(array);
  if (const auto* reals = std::get_if<std::vector<double>>(&stored.values)) {
    put_matrix(out, name, ArrayClass::float64, 0, stored.shape, [&] {
      put_data(out, DataType::float64, reals->data(), reals->size() * sizeof(double));
    });
    return;
  }
  std::vector<double> real, imaginary;
  for (const std::complex<double>& value : std::get<1>(stored.values)) {
    real.push_back(value.real());
    imaginary.push_back(value.imag());
  }
  put_matrix(out, name, ArrayClass::float64, kComplexFlag, stored.shape, [&] {
    for (const std::vector<double>* part : {&real, &imaginary})
      put_data(out, DataType::float64, part->data(), part->size() * sizeof(double));
  });
}

void put_variable(std::string& out, const MatVariable& variable, const std::string& name);

void put_struct(std::string& out, const MatVariable& variable, const std::string& name) {
  std::size_t longest = 0;
  for (const MatVariable& field : variable.fields) longest = std::max(longest, field.name.size());
  const auto width = static_cast<std::int32_t>(longest + 1);
  std::string names;
  for (const MatVariable& field : variable.fields) {
    names += field.name;
    names.append(static_cast<std::size_t>(width) - field.name.size(), '\0');
  }
  put_matrix(out, name, ArrayClass::structure, 0, {1, 1}, [&] {
    put_data(out, DataType::int32, &width, sizeof(width));
    put_data(out, DataType::int8, names.data(), names.size());
    for (const MatVariable& field : variable.fields) put_variable(out, field, "");
  });
}

void put_variable(std::string& out, const MatVariable& variable, const std::string& name) {
  if (variable.array == nullptr) return put_struct(out, variable, name);
  const NamedArray& array = *variable.array;
  if (!array.is_text()) return put_numbers(out, name, array);
  const auto& texts = std::get<std::vector<std::string>>(array.values);
  if (array.shape.empty()) return put_text(out, name, texts.at(0));
  put_matrix(out, name, ArrayClass::cell, 0, {texts.size(), 1}, [&] {
    for (const std::string& text : texts) put_text(out, "", text);
  });
}

}  // namespace

std::string mat5_element(const MatVariable& variable) {
  std::string out;
  put_variable(out, variable, variable.name);
  return out;
}

}  // namespace stageid
