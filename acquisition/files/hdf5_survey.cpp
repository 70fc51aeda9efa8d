#include <map>
#include <string>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_support.hpp"

namespace stageid::hdf5 {
namespace {

constexpr std::size_t kMostPaths = 20'000;

class Survey {
 public:
  explicit Survey(const Hdf5File& file) : file_(file) {}

  /// @returns the number of paths to objects from here, at most a few more than kMostPaths: two links to each group of
  /// a chain double it.
  std::size_t visit(const std::string& object) {
    H5O_info_t info;
    if (H5Oget_info_by_name(file_.id(), object.c_str(), &info, H5P_DEFAULT) < 0) return 0;
    const auto [known, is_new] = paths_.try_emplace(info.addr, kOpen);
    if (!is_new && known->second == kOpen)
      throw FormatError(file_.path(), object, "is a group that contains itself; remove the link");
    if (!is_new) return known->second;
    read([&] { visit_attributes(object); });
    if (info.type == H5O_TYPE_DATASET) visit_dataset(object);
    std::size_t paths = 1;
    if (info.type == H5O_TYPE_GROUP) paths += visit_group(object);
    return paths_[info.addr] = paths;
  }

 private:
  [[noreturn]] void refuse(const std::string& object, const char* what) const {
    fail_format(file_.path(), object,
                "{} another file; copy the file with its data, for example with h5repack, and give "
                "the copy",
                what);
  }

  /// What cannot be read is reported where it is needed.
  template <typename Read>
  static void read(Read part) {
    try {
      part();
    } catch (const FormatError&) {
    }
  }

  void visit_attributes(const std::string& object) const {
    for (const std::string& name : file_.attributes(object))
      read([&] {
        const Hdf5Kind kind = file_.attribute_kind(object, name);
        if (kind == Hdf5Kind::text) file_.read_texts_attribute(object, name);
        if (kind == Hdf5Kind::real || kind == Hdf5Kind::integer)
          file_.read_reals_attribute(object, name);
      });
  }

  void visit_dataset(const std::string& dataset) const {
    {
      const Hdf5Handle handle(H5Dopen2(file_.id(), dataset.c_str(), H5P_DEFAULT), H5Dclose);
      if (!handle) return;
      const Hdf5Handle properties(H5Dget_create_plist(handle.get()), H5Pclose);
      if (H5Pget_external_count(properties.get()) > 0) refuse(dataset, "is stored in");
      if (H5Pget_layout(properties.get()) == H5D_VIRTUAL) refuse(dataset, "is a view of");
    }
    read([&] {
      if (file_.kind(dataset) == Hdf5Kind::text) file_.read_texts(dataset);
    });
  }

  std::size_t visit_group(const std::string& group) {
    const Hdf5Handle handle(H5Gopen2(file_.id(), group.c_str(), H5P_DEFAULT), H5Gclose);
    if (!handle) return 0;
    struct Link {
      std::string name;
      H5L_type_t type;
    };
    std::vector<Link> links;
    const auto collect = [](hid_t, const char* name, const H5L_info_t* info, void* list) -> herr_t {
      static_cast<std::vector<Link>*>(list)->push_back({name, info->type});
      return 0;
    };
    H5Literate(handle.get(), H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &links);
    std::size_t paths = 0;
    for (const Link& link : links) {
      const std::string child = (group == "/" ? "" : group) + "/" + link.name;
      if (link.type > H5L_TYPE_SOFT) refuse(child, "is a link to");
      if (link.type == H5L_TYPE_HARD) paths += visit(child);  // a soft link points to one
      if (paths > kMostPaths)
        fail_format(file_.path(), "",
                    "contains more than {} objects; copy the needed ones to a new file",
                    kMostPaths);
    }
    return paths;
  }

  const Hdf5File& file_;
  static constexpr std::size_t kOpen = 0;  ///< while its children are visited
  std::map<haddr_t, std::size_t> paths_;
};

}  // namespace

void survey(const Hdf5File& file) { Survey(file).visit("/"); }

}  // namespace stageid::hdf5
