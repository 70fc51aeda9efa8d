#include <fmt/format.h>

#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {
namespace {

constexpr int kDeepest = 20;  // deeper groups are not expected

void read_attributes(const Hdf5File& file, const std::string& object, ArrayList& list) {
  for (const std::string& name : file.attributes(object)) {
    const Hdf5Kind kind = file.attribute_kind(object, name);
    NamedArray array{fmt::format("{}@{}", object.substr(1), name), {}, {}};
    if (kind == Hdf5Kind::text)
      array.values = file.read_texts_attribute(object, name);
    else if (kind == Hdf5Kind::real || kind == Hdf5Kind::integer)
      array.values = file.read_reals_attribute(object, name);
    else
      continue;
    if (array.size() != 1) array.shape = {array.size()};
    list.arrays.push_back(std::move(array));
  }
}

void read_dataset(const Hdf5File& file, const std::string& dataset, ArrayList& list) {
  const std::vector<hsize_t> shape = file.shape(dataset);
  NamedArray array{dataset.substr(1), {shape.begin(), shape.end()}, {}};
  switch (file.kind(dataset)) {
    case Hdf5Kind::real:
    case Hdf5Kind::integer:
      array.values = file.read_reals(dataset);
      break;
    case Hdf5Kind::complex:
      array.values = file.read_complex(dataset);
      break;
    case Hdf5Kind::text:
      if (array.shape.size() != 1) return;
      array.values = file.read_texts(dataset);
      break;
    case Hdf5Kind::other:
      return;
  }
  list.arrays.push_back(std::move(array));
}

void read_object(const Hdf5File& file, const std::string& object, int depth, ArrayList& list) {
  if (depth > kDeepest) return;
  read_attributes(file, object, list);
  if (!file.is_group(object)) {
    read_dataset(file, object, list);
    return;
  }
  for (const std::string& child : file.children(object))
    if (const std::string name = fmt::format("{}/{}", object == "/" ? "" : object, child);
        file.exists(name))
      read_object(file, name, depth + 1, list);
}

void write_attribute(Hdf5File& file, const NamedArray& array, std::size_t at) {
  const std::string object = fmt::format("/{}", array.name.substr(0, at));
  const std::string name = array.name.substr(at + 1);
  const auto write = [&](const auto& values) {
    if (array.shape.empty())
      file.write_attribute(object, name, values.at(0));
    else
      file.write_attribute(object, name, values);
  };
  if (array.is_text()) write(std::get<2>(array.values));
  if (!array.is_text() && !array.is_complex()) write(std::get<0>(array.values));
}

void write_dataset(Hdf5File& file, const NamedArray& array) {
  for (std::size_t slash = array.name.find('/'); slash != std::string::npos;
       slash = array.name.find('/', slash + 1))
    if (const std::string group = fmt::format("/{}", array.name.substr(0, slash));
        !file.exists(group))
      file.create_group(group);
  const std::string dataset = fmt::format("/{}", array.name);
  const std::vector<hsize_t> shape(array.shape.begin(), array.shape.end());
  if (array.is_text())
    file.write_texts(dataset, std::get<2>(array.values));
  else if (array.is_complex())
    file.write_complex(dataset, shape, std::get<1>(array.values).data());
  else
    file.write_reals(dataset, shape, std::get<0>(array.values).data());
}

}  // namespace

ArrayList read_hdf5_arrays(const std::filesystem::path& path) {
  note_input(path);
  return arrays_in_child(path, [](const std::filesystem::path& file) {
    ArrayList list{file, {}};
    read_object(Hdf5File::open(file), "/", 0, list);
    return list;
  });
}

void write_hdf5_arrays(const std::filesystem::path& path, const ArrayList& list) {
  OutputFile output(path);
  Hdf5File file = Hdf5File::create(output.path(), path);
  // Attributes need their object: datasets first.
  for (const NamedArray& array : list.arrays)
    if (array.name.find('@') == std::string::npos) write_dataset(file, array);
  for (const NamedArray& array : list.arrays)
    if (const std::size_t at = array.name.find('@'); at != std::string::npos)
      write_attribute(file, array, at);
  file.close();
  output.commit();
}

}  // namespace stageid
