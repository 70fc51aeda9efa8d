#include "tools/python/frf_handle.hpp"

#include <cstddef>

#include "acquisition/files/fingerprint.hpp"
#include "frf/file/frf_file.hpp"

namespace stageid {

FrfHandle read_frf_handle(const std::filesystem::path& file) {
  return FrfHandle(read_frf(file), file.filename().string(), fingerprint_of_file(file));
}

std::string fingerprint_of_content(const FrfEstimate& frf) {
  Fingerprint fingerprint;
  const auto add = [&](const auto& matrix) {
    fingerprint.add({reinterpret_cast<const std::byte*>(matrix.data()),
                     static_cast<std::size_t>(matrix.size()) * sizeof(*matrix.data())});
  };
  add(frf.frequency_hz);
  add(frf.response);
  add(frf.noise_variance);
  add(frf.total_variance);
  return fingerprint.hex();
}

}  // namespace stageid
