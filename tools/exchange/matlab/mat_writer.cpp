#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <string>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/version.hpp"
#include "tools/exchange/matlab/mat_file.hpp"

namespace stageid {
namespace {

/// A MATLAB identifier: letters, digits, underscores, not starting with a digit.
std::string identifier(std::string name) {
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  const bool begins_well = !name.empty() && std::isdigit(static_cast<unsigned char>(name[0])) == 0;
  return begins_well ? name : "x" + name;
}

/// Path of structs and the field: "/a/0001/b@unit" -> a, x0001, b_unit; "@format" -> format.
std::vector<std::string> path_of(std::string name) {
  if (name.starts_with('@')) name.erase(0, 1);
  std::ranges::replace(name, '@', '_');
  if (const std::size_t at = name.find("/_"); at != std::string::npos) name.erase(at + 1, 1);
  std::vector<std::string> path;
  std::size_t first = 0;
  for (std::size_t slash = 0; slash != std::string::npos; first = slash + 1) {
    slash = name.find('/', first);
    path.push_back(identifier(name.substr(first, slash - first)));
  }
  return path;
}

/// The variables of the file in the order of their first appearance.
std::vector<MatVariable> variables_of(const ArrayList& list) {
  std::vector<MatVariable> variables;
  for (const NamedArray& array : list.arrays) {
    MatVariable* variable = nullptr;
    for (const std::string& name : path_of(array.name)) {
      std::vector<MatVariable>& siblings = variable == nullptr ? variables : variable->fields;
      auto found = std::ranges::find(siblings, name, &MatVariable::name);
      if (found == siblings.end()) found = siblings.insert(found, {name, nullptr, {}});
      variable = &*found;
    }
    variable->array = &array;
  }
  return variables;
}

/// Checks the size limits; a variable is an array or a struct with its whole content.
void require_room(const ArrayList& list) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 31;
  std::map<std::string, std::size_t> bytes;
  for (const NamedArray& array : list.arrays) {
    if (array.is_text()) continue;
    const std::string variable = path_of(array.name).front();
    std::size_t& sum = bytes[variable];
    sum += array.size() * (array.is_complex() ? 16 : 8);
    if (sum >= kMostBytes)
      fail_request(
          "{}: '{}' has 2 GiB or more, too large for a variable of a MATLAB v5 file; add "
          "--mat-version 7.3",
          list.file.string(), variable);
  }
}

/// 124 bytes of text, version and byte order. The text depends on the content only, not on the time.
std::string head_of(MatVersion version) {
  const bool v5 = version == MatVersion::v5;
  std::string head = fmt::format("MATLAB {} MAT-file, written by stageid {}", v5 ? "5.0" : "7.3",
                                 stageid::version());
  head.resize(116, ' ');
  head.append(8, '\0');
  head.append({'\0', v5 ? '\1' : '\2', 'I', 'M'});
  return head;
}

}  // namespace

NamedArray as_matlab_stores(const NamedArray& array) {
  NamedArray paged = array;
  if (array.shape.size() == 3) paged = permuted(array, {1, 2, 0});
  const std::vector<std::size_t> shape = paged.shape;
  NamedArray stored = reversed(paged);
  stored.shape = shape;
  while (stored.shape.size() < 2) stored.shape.push_back(1);
  return stored;
}

MatWriter::MatWriter(const std::filesystem::path& file, MatVersion version)
    : version_(version), output_(file) {
  if (version == MatVersion::v5)
    output_.append(head_of(version));
  else
    hdf5_.emplace(output_.path(), file);
}

void MatWriter::add(const ArrayList& list) {
  if (!hdf5_) require_room(list);
  for (const MatVariable& variable : variables_of(list))
    if (hdf5_)
      hdf5_->add(variable);
    else
      output_.append(mat5_element(variable));
}

void MatWriter::close() {
  if (hdf5_) hdf5_->close(head_of(version_));
  output_.commit();
}

void write_mat(const std::filesystem::path& file, const ArrayList& list, MatVersion version) {
  MatWriter writer(file, version);
  writer.add(list);
  writer.close();
}

}  // namespace stageid
