#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/system_reason.hpp"
#include "acquisition/files/version.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

using MatFile = std::unique_ptr<mat_t, int (*)(mat_t*)>;
using Variable = std::unique_ptr<matvar_t, void (*)(matvar_t*)>;

Variable owned(matvar_t* variable) {
  if (variable == nullptr) throw std::bad_alloc();
  return {variable, &Mat_VarFree};
}

/// A MATLAB identifier: letters, digits, underscores, not starting with a digit.
std::string identifier(std::string name) {
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return std::isdigit(static_cast<unsigned char>(name.front())) != 0 ? "x" + name : name;
}

/// Path of structs and the field: "/a/0001/b@unit" -> a, x0001, b_unit; "@format" -> format.
std::vector<std::string> path_of(std::string name) {
  if (name.starts_with('@')) name.erase(0, 1);
  std::replace(name.begin(), name.end(), '@', '_');
  if (const std::size_t at = name.find("/_"); at != std::string::npos) name.erase(at + 1, 1);
  std::vector<std::string> path;
  std::size_t first = 0;
  for (std::size_t slash = 0; slash != std::string::npos; first = slash + 1) {
    slash = name.find('/', first);
    path.push_back(identifier(name.substr(first, slash - first)));
  }
  return path;
}

Variable text_variable(const std::string& name, const std::string& text) {
  std::u16string units = utf16_of(text);
  std::size_t dims[2] = {units.empty() ? std::size_t{0} : 1, units.size()};
  return owned(Mat_VarCreate(name.c_str(), MAT_C_CHAR, MAT_T_UINT16, 2, dims, units.data(), 0));
}

Variable texts_variable(const std::string& name, const std::vector<std::string>& texts) {
  std::size_t dims[2] = {texts.size(), 1};
  Variable cell = owned(Mat_VarCreate(name.c_str(), MAT_C_CELL, MAT_T_CELL, 2, dims, nullptr, 0));
  for (std::size_t k = 0; k < texts.size(); ++k)
    Mat_VarSetCell(cell.get(), static_cast<int>(k), text_variable("", texts[k]).release());
  return cell;
}

/// In the order of MATLAB and with at least two axes.
NamedArray as_matlab_stores(const NamedArray& array) {
  NamedArray paged = array;
  if (array.shape.size() == 3) paged = permuted(array, {1, 2, 0});
  const std::vector<std::size_t> shape = paged.shape;
  NamedArray stored = reversed(paged);
  stored.shape = shape;
  while (stored.shape.size() < 2) stored.shape.push_back(1);
  return stored;
}

Variable number_variable(const std::string& name, const NamedArray& array) {
  NamedArray stored = as_matlab_stores(array);
  const int rank = static_cast<int>(stored.shape.size());
  if (auto* reals = std::get_if<std::vector<double>>(&stored.values))
    return owned(Mat_VarCreate(name.c_str(), MAT_C_DOUBLE, MAT_T_DOUBLE, rank, stored.shape.data(),
                               reals->data(), 0));
  std::vector<double> real, imaginary;
  for (const std::complex<double>& value : std::get<1>(stored.values)) {
    real.push_back(value.real());
    imaginary.push_back(value.imag());
  }
  mat_complex_split_t parts{real.data(), imaginary.data()};
  return owned(Mat_VarCreate(name.c_str(), MAT_C_DOUBLE, MAT_T_DOUBLE, rank, stored.shape.data(),
                             &parts, MAT_F_COMPLEX));
}

Variable variable_of(const std::string& name, const NamedArray& array) {
  const auto* texts = std::get_if<std::vector<std::string>>(&array.values);
  if (texts == nullptr) return number_variable(name, array);
  return array.shape.empty() ? text_variable(name, texts->at(0)) : texts_variable(name, *texts);
}

void set_field(matvar_t* parent, const std::string& name, Variable value) {
  if (Mat_VarGetStructFieldByName(parent, name.c_str(), 0) == nullptr &&
      Mat_VarAddStructField(parent, name.c_str()) != 0)
    throw std::bad_alloc();
  Mat_VarSetStructFieldByName(parent, name.c_str(), 0, value.release());
}

Variable empty_struct(const std::string& name) {
  const std::size_t dims[2] = {1, 1};
  return owned(Mat_VarCreateStruct2(name.c_str(), 2, dims, nullptr));
}

/// Inserts `array` into the struct at its path.
void insert(matvar_t* parent, const std::vector<std::string>& path, const NamedArray& array) {
  for (std::size_t level = 1; level + 1 < path.size(); ++level) {
    matvar_t* child = Mat_VarGetStructFieldByName(parent, path[level].c_str(), 0);
    if (child == nullptr) {
      set_field(parent, path[level], empty_struct(path[level]));
      child = Mat_VarGetStructFieldByName(parent, path[level].c_str(), 0);
    }
    parent = child;
  }
  set_field(parent, path.back(), variable_of(path.back(), array));
}

/// The variables of the file in the order of their first appearance.
std::vector<Variable> variables_of(const ArrayList& list) {
  std::vector<Variable> variables;
  for (const NamedArray& array : list.arrays) {
    const std::vector<std::string> path = path_of(array.name);
    if (path.size() == 1) {
      variables.push_back(variable_of(path[0], array));
      continue;
    }
    auto found = std::find_if(variables.begin(), variables.end(),
                              [&](const Variable& v) { return v->name == path[0]; });
    if (found == variables.end()) found = variables.insert(variables.end(), empty_struct(path[0]));
    insert(found->get(), path, array);
  }
  return variables;
}

/// Checks the size limits; a variable is an array or a struct with its whole content.
void require_room(const ArrayList& list) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 31;
  std::map<std::string, std::size_t> bytes;
  for (const NamedArray& array : list.arrays) {
    if (array.is_text()) continue;
    std::size_t& sum = bytes[path_of(array.name).front()];
    sum += array.size() * (array.is_complex() ? 16 : 8);
    if (sum >= kMostBytes)
      throw std::invalid_argument(
          fmt::format("{}: '{}' has 2 GiB or more, too large for a variable of a MATLAB v5 file; "
                      "add --mat-version 7.3",
                      list.file.string(), path_of(array.name).front()));
  }
}

}  // namespace

struct MatWriter::State {
  State(const std::filesystem::path& to, MatVersion wanted)
      : path(to), version(wanted), output(to) {}

  [[noreturn]] void fail() const {
    throw FileError(fmt::format("{}: cannot be written: {}", path.string(), system_reason(errno)));
  }

  std::filesystem::path path;
  MatVersion version;
  OutputFile output;
  MatFile file{nullptr, &Mat_Close};
};

MatWriter::MatWriter(const std::filesystem::path& file, MatVersion version)
    : state_(std::make_unique<State>(file, version)) {
  const bool v5 = version == MatVersion::v5;
  // The default header contains the time; ours depends on the content only.
  const std::string header = fmt::format("MATLAB {} MAT-file, written by stageid {}",
                                         v5 ? "5.0" : "7.3", stageid::version());
  state_->file.reset(Mat_CreateVer(state_->output.path().c_str(), header.c_str(),
                                   v5 ? MAT_FT_MAT5 : MAT_FT_MAT73));
  if (!state_->file) state_->fail();
}

MatWriter::~MatWriter() = default;

void MatWriter::add(const ArrayList& list) {
  if (state_->version == MatVersion::v5) require_room(list);
  for (const Variable& variable : variables_of(list))
    if (Mat_VarWrite(state_->file.get(), variable.get(), MAT_COMPRESSION_NONE) != 0) state_->fail();
}

void MatWriter::close() {
  if (Mat_Close(state_->file.release()) != 0) state_->fail();
  state_->output.commit();
}

void write_mat(const std::filesystem::path& file, const ArrayList& list, MatVersion version) {
  MatWriter writer(file, version);
  writer.add(list);
  writer.close();
}

}  // namespace stageid
