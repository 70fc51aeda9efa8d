#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace stageid::test {

/// A new empty directory that is removed with its content. In memory if possible: the disk is not under test, and
/// synchronizing files takes milliseconds each there.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    if (!make_in("/dev/shm") && !make_in(std::filesystem::temp_directory_path())) {
      throw std::runtime_error("mkdtemp failed");
    }
  }
  /// Where the disk does matter.
  explicit TemporaryDirectory(const std::filesystem::path& parent) {
    if (!make_in(parent)) throw std::runtime_error("mkdtemp failed");
  }
  ~TemporaryDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryDirectory(TemporaryDirectory&&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const noexcept { return path_; }

 private:
  bool make_in(const std::filesystem::path& parent) {
    std::string name = (parent / "stageid-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) return false;
    path_ = name;
    return true;
  }

  std::filesystem::path path_;
};

}  // namespace stageid::test
