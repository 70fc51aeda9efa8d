#include "acquisition/files/hdf5_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "acquisition/files/child_process.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/hdf5_library.hpp"
#include "acquisition/files/hdf5_support.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {

void prepare_hdf5() noexcept {
  static const herr_t no_clean_up_at_exit = H5dont_atexit();
  static_cast<void>(no_clean_up_at_exit);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

namespace {

/// HDF5's messages do not distinguish a missing file from a forbidden one; the operating system's do.
void check_can_be_opened(const std::filesystem::path& file) {
  const FileDescriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (!descriptor) fail_file(file, "cannot be read: {}", system_reason(errno));
  struct stat status {};
  if (::fstat(descriptor.get(), &status) != 0 || !S_ISREG(status.st_mode))
    fail_file(file, "is not a regular file; give the name of an HDF5 file");
}

}  // namespace

/// Recently read or appended datasets. A reopened dataset starts with an empty chunk cache, so opening it for
/// every block of rows would decompress the same chunks repeatedly.
struct Hdf5File::OpenDatasets {
  struct Entry {
    std::string name;
    Hdf5Handle handle;
  };
  static constexpr std::size_t kEntries = 4;  // the datasets of one run of a log
  std::array<Entry, kEntries> entries;
  std::size_t oldest = 0;
};

Hdf5File::Hdf5File(std::filesystem::path path, Hdf5Handle file)
    : path_(std::move(path)),
      file_(std::move(file)),
      open_datasets_(std::make_unique<OpenDatasets>()) {}
Hdf5File::~Hdf5File() = default;
Hdf5File::Hdf5File(Hdf5File&&) noexcept = default;
Hdf5File& Hdf5File::operator=(Hdf5File&&) noexcept = default;

Hdf5File Hdf5File::open(const std::filesystem::path& file) {
  prepare_hdf5();
  note_input(file);
  check_can_be_opened(file);
  if (H5Fis_hdf5(file.c_str()) <= 0) {
    H5Eclear2(H5E_DEFAULT);
    // other_kind() opens HDF5 files to read their format.
    const std::string other = is_hdf5(file) ? "" : other_kind(file, "an HDF5 file");
    throw FormatError(file, "",
                      !other.empty()
                          ? other
                          : "is not an HDF5 file, or its header is damaged; give an HDF5 file");
  }
  hdf5::check_global_heaps(file);
  in_child(file, [&] {
    hdf5::survey(opened(file));
    return std::string();
  });
  return opened(file);
}

Hdf5File Hdf5File::opened(const std::filesystem::path& file) {
  Hdf5Handle handle(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!handle)
    fail_format(file, "",
                "the HDF5 file is truncated, damaged or still being written{}; copy it again or "
                "recreate it",
                hdf5::take_system_reason());
  return {file, std::move(handle)};
}

Hdf5File Hdf5File::create(const std::filesystem::path& file,
                          const std::filesystem::path& shown_as) {
  const std::filesystem::path named = shown_name(shown_as.empty() ? file : shown_as);
  prepare_hdf5();
  const Hdf5Handle properties = hdf5::property_list(H5P_FILE_CREATE);
  H5Pset_obj_track_times(properties.get(), false);
  // The format of HDF5 1.8 has checksums on most of its structure, which detect damage before the library
  // fails on it. Older MATLAB versions cannot read the newest format.
  const Hdf5Handle access = hdf5::property_list(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_V18);
  Hdf5Handle handle(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, properties.get(), access.get()),
                    H5Fclose);
  if (!handle) fail_file(named, "cannot be created: {}", with_remedy(hdf5::take_reason()));
  return {named, std::move(handle)};
}

void Hdf5File::close() {
  if (!file_) return;
  std::string reason;
  const auto require = [&reason](bool done) {
    if (!done && reason.empty()) reason = with_remedy(hdf5::take_reason());
  };
  for (OpenDatasets::Entry& entry : open_datasets_->entries) require(entry.handle.close());
  require(H5Fflush(file_.get(), H5F_SCOPE_GLOBAL) >= 0);
  require(file_.close());
  if (!reason.empty()) throw FileError(path_.string() + ": cannot be written: " + reason);
}

bool Hdf5File::exists(const std::string& object) const {
  // H5Lexists fails instead of returning false if a parent group is missing.
  for (std::size_t end = object.find('/', 1);; end = object.find('/', end + 1)) {
    const std::string part = object.substr(0, end);
    if (part != "/" && H5Lexists(file_.get(), part.c_str(), H5P_DEFAULT) <= 0) {
      H5Eclear2(H5E_DEFAULT);
      return false;
    }
    if (end == std::string::npos) break;
  }
  return object == "/" || H5Oexists_by_name(file_.get(), object.c_str(), H5P_DEFAULT) > 0;
}

bool Hdf5File::is_group(const std::string& object) const {
  if (!exists(object)) return false;
  const Hdf5Handle handle(H5Oopen(file_.get(), object.c_str(), H5P_DEFAULT), H5Oclose);
  const bool found = handle && H5Iget_type(handle.get()) == H5I_GROUP;
  H5Eclear2(H5E_DEFAULT);
  return found;
}

std::vector<std::string> Hdf5File::children(const std::string& group) const {
  const auto fail = [&](const std::string& what) { throw FormatError(path_, group, what); };
  if (!exists(group)) fail("is missing; expected a group");
  const Hdf5Handle handle(H5Gopen2(file_.get(), group.c_str(), H5P_DEFAULT), H5Gclose);
  if (!handle) {
    hdf5::take_reason();
    fail("is not a group; expected a group");
  }
  std::vector<std::string> names;
  if (H5Literate(handle.get(), H5_INDEX_NAME, H5_ITER_INC, nullptr, hdf5::collect_name<H5L_info_t>,
                 &names) < 0) {
    fail("cannot be listed" + hdf5::take_system_reason() + "; the file is damaged, copy it again");
  }
  return names;
}

/// HDF5 allocates a whole chunk, however few of its rows exist.
void Hdf5File::check_chunk(const std::string& dataset, hid_t id) const {
  const Hdf5Handle properties(H5Dget_create_plist(id), H5Pclose);
  if (H5Pget_layout(properties.get()) != H5D_CHUNKED) return;
  const Hdf5Handle type(H5Dget_type(id), H5Tclose);
  std::vector<hsize_t> chunk(H5S_MAX_RANK);
  const int rank = H5Pget_chunk(properties.get(), H5S_MAX_RANK, chunk.data());
  chunk.resize(std::clamp(rank, 0, H5S_MAX_RANK));
  hdf5::plausible_count(path_, dataset, chunk, H5Tget_size(type.get()),
                        H5Pget_nfilters(properties.get()) > 0);
}

hid_t Hdf5File::open_dataset(const std::string& dataset) const {
  for (const OpenDatasets::Entry& entry : open_datasets_->entries) {
    if (entry.handle && entry.name == dataset) return entry.handle.get();
  }
  if (!exists(dataset)) throw FormatError(path_, dataset, "is missing; expected a dataset");
  // Enough for a chunk of all columns of typical logs; the default is 1 MiB.
  constexpr std::size_t kChunkCacheBytes = std::size_t{1} << 24;
  constexpr std::size_t kChunkCacheSlots = 12421;  // a prime, as HDF5 recommends
  const Hdf5Handle access = hdf5::property_list(H5P_DATASET_ACCESS);
  H5Pset_chunk_cache(access.get(), kChunkCacheSlots, kChunkCacheBytes, 1.0);
  Hdf5Handle handle(H5Dopen2(file_.get(), dataset.c_str(), access.get()), H5Dclose);
  if (!handle)
    fail_format(path_, dataset, "is not a dataset, or is damaged{}; expected a dataset",
                hdf5::take_system_reason());
  check_chunk(dataset, handle.get());
  OpenDatasets::Entry& entry = open_datasets_->entries[open_datasets_->oldest];
  if (!entry.handle.close())
    throw FileError(path_.string() + ":" + entry.name +
                    ": cannot be written: " + with_remedy(hdf5::take_reason()));
  open_datasets_->oldest = (open_datasets_->oldest + 1) % OpenDatasets::kEntries;
  entry.handle = std::move(handle);
  entry.name = dataset;
  return entry.handle.get();
}

}  // namespace stageid
