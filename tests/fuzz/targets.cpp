#include "tests/fuzz/targets.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "acquisition/slog/crc32c.hpp"
#include "acquisition/slog/slog_format.hpp"
#include "acquisition/slog/slog_recover.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "frf/file/frf_file.hpp"
#include "hal/can/can_encoding.hpp"
#include "hal/can/can_frame.hpp"
#include "hal/modbus/modbus_answer.hpp"
#include "hal/modbus/modbus_request_frame.hpp"
#include "hal/stage/stage.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/yaml_document.hpp"
#include "tools/dashboard/dashboard_server.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/exchange/arrays/frf_csv.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/exchange/arrays/touchstone_reader.hpp"
#include "tools/exchange/import/import_map.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/uff/uff_file.hpp"

namespace stageid::fuzz {
namespace {

namespace fs = std::filesystem;

/// A file with these bytes, in memory, with the ending that the reader expects.
class ScratchFile {
 public:
  ScratchFile(Bytes bytes, std::string_view ending)
      : path_(fs::path("/dev/shm") / fmt::format("stageid_fuzz_{}{}", ::getpid(), ending)) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  ~ScratchFile() {
    std::error_code ignored;
    fs::remove(path_, ignored);
  }
  ScratchFile(ScratchFile&&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

std::string text_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void read_yaml(Bytes bytes) { YamlDocument::parse("fuzz.yaml", text_of(bytes)); }

void read_everything(const LogReader& log) {
  LogSamples samples;
  for (std::size_t run = 0; run < log.runs().size(); ++run) {
    log.excitation(run);
    log.read(run, 0, log.runs()[run].samples, samples);
  }
}

/// Checksums are made right, so that mutations get past them.
std::vector<std::uint8_t> with_checksums(Bytes bytes) {
  std::vector<std::uint8_t> log(bytes.begin(), bytes.end());
  for (std::size_t at = 0; log.size() - at >= sizeof(SlogBlockHeader);) {
    SlogBlockHeader header;
    std::memcpy(&header, log.data() + at, sizeof(header));
    const std::uint64_t size = slog_block_bytes(header);
    if (size > log.size() - at) break;
    header.magic = kSlogMagic;
    header.payload_crc = crc32c(std::as_bytes(std::span(log).subspan(
        at + sizeof(header), static_cast<std::size_t>(size) - sizeof(header))));
    header.header_crc = slog_header_crc(header);
    std::memcpy(log.data() + at, &header, sizeof(header));
    at += static_cast<std::size_t>(size);
  }
  return log;
}

void read_slog(Bytes bytes) {
  const ScratchFile file(with_checksums(bytes), ".slog");
  const fs::path recovered = file.path().string() + ".recovered.slog";
  recover_log(file.path(), recovered);
  const VerifyReport report = verify_log(recovered);
  fs::remove(recovered);
  if (!report.damage.empty()) throw std::logic_error("a recovered log is damaged");
  verify_log(file.path());
  read_everything(*open_log(file.path()));
}

void read_torn_slog(Bytes bytes) {
  const ScratchFile file(bytes, ".slog");
  verify_log(file.path());
  read_everything(*open_log(file.path()));
}

void read_hdf5_log(Bytes bytes) {
  const ScratchFile file(bytes, ".h5");
  read_everything(*open_log(file.path()));
}

constexpr char kAnyName[] = "";
constexpr char kYaml[] = ".yaml";
constexpr char kHdf5[] = ".h5";
constexpr char kTouchstone[] = ".s2p";

/// A reader that takes the path of a file alone.
template <auto read, const char* ending = kAnyName>
void read_file(Bytes bytes) {
  const ScratchFile file(bytes, ending);
  read(file.path());
}

void read_frf_hdf5(Bytes bytes) {
  const ScratchFile file(bytes, kHdf5);
  read_frf(file.path());
}

void read_csv_tables(Bytes bytes) {
  const ScratchFile file(bytes, ".csv");
  read_csv(file.path());
  if (is_frf_csv(file.path())) read_frf_csv(file.path());
}

/// The bytes as the only member of an archive, because mutations of a whole archive fail at its checksum.
void read_npy(Bytes bytes) {
  const ScratchFile file({}, ".npz");
  zip_t* archive = zip_open(file.path().c_str(), ZIP_CREATE | ZIP_TRUNCATE, nullptr);
  if (archive == nullptr) throw std::runtime_error("no archive in /dev/shm");
  zip_source_t* member = zip_source_buffer(archive, bytes.data(), bytes.size(), 0);
  if (zip_file_add(archive, "array.npy", member, ZIP_FL_OVERWRITE) < 0 || zip_close(archive) != 0)
    throw std::runtime_error("the archive was not written");
  read_npz(file.path());
}

class Registers final : public ModbusRegisters {
 public:
  void begin_request(ModbusConnection) override {}
  void tick() override {}
  ModbusException write(int first, std::span<const std::uint16_t> values) override {
    if (!has(first, values.size())) return ModbusException::illegal_address;
    std::copy(values.begin(), values.end(), registers_.begin() + first);
    return ModbusException::none;
  }
  ModbusException read(int first, std::span<std::uint16_t> values) override {
    if (!has(first, values.size())) return ModbusException::illegal_address;
    std::copy_n(registers_.begin() + first, values.size(), values.begin());
    return ModbusException::none;
  }

 private:
  bool has(int first, std::size_t count) const {
    return first >= 0 && static_cast<std::size_t>(first) + count <= registers_.size();
  }
  std::array<std::uint16_t, 1000> registers_{};
};

void answer_modbus(Bytes bytes) {
  static Registers registers;
  std::array<std::uint8_t, kLargestPdu> reply{};
  for (const ModbusRequest& request :
       {parse_tcp_request(bytes), parse_rtu_request(bytes), find_rtu_request(bytes, 1)})
    answer_request(request.pdu, 1, registers, reply);
  answer_request(bytes, 1, registers, reply);
}

void decode_can(Bytes bytes) {
  CanFrame frame;
  frame.length = static_cast<std::uint8_t>(std::min(bytes.size(), frame.data.size()));
  std::copy_n(bytes.begin(), frame.length, frame.data.begin());
  if (frame.length >= kCanHeaderBytes) {
    const std::uint16_t crc = can_frame_crc(frame);
    std::memcpy(frame.data.data() + 6, &crc, sizeof(crc));
  }
  CanCommand command;
  CanState state;
  CanChunk chunk;
  CanMissing missing;
  std::size_t part = 0;
  std::string piece;
  for (const bool known : {decode_can_command(frame, command), decode_can_state(frame, state),
                           decode_can_text(frame, part, piece), decode_can_chunk(frame, chunk),
                           decode_can_missing(frame, missing)})
    static_cast<void>(known);
}

/// A server that is asked over a real socket.
void ask_dashboard(Bytes bytes) {
  static DashboardContent content;
  static const bool is_filled = [] {
    content.page = "<!DOCTYPE html>";
    content.abort = [] {};
    return true;
  }();
  static_cast<void>(is_filled);
  static DashboardServer server({"127.0.0.1", 0}, content);
  static const int port = std::stoi(server.url().substr(server.url().rfind(':') + 1));
  const int client = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
    static_cast<void>(!::send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL));
    ::shutdown(client, SHUT_WR);
    char answer[4096];
    for (int k = 0; k < 16 && ::recv(client, answer, sizeof(answer), 0) > 0; ++k) {
    }
  }
  ::close(client);
}

constexpr std::array kTargets = {Target{"yaml", read_yaml},
                                 Target{"stage", read_file<load_stage_config, kYaml>},
                                 Target{"map", read_file<read_import_map, kYaml>},
                                 Target{"slog", read_slog},
                                 Target{"torn_slog", read_torn_slog},
                                 Target{"hdf5_log", read_hdf5_log},
                                 Target{"hdf5_frf", read_frf_hdf5},
                                 Target{"excitation", read_file<read_experiment_plan, kHdf5>},
                                 Target{"hdf5_arrays", read_file<read_hdf5_arrays>},
                                 Target{"model", read_file<read_model>},
                                 Target{"modes", read_file<read_modes>},
                                 Target{"uff", read_file<read_uff>},
                                 Target{"mat", read_file<read_mat>},
                                 Target{"npz", read_file<read_npz>},
                                 Target{"npy", read_npy},
                                 Target{"csv", read_csv_tables},
                                 Target{"touchstone", read_file<read_touchstone, kTouchstone>},
                                 Target{"modbus", answer_modbus},
                                 Target{"can", decode_can},
                                 Target{"dashboard", ask_dashboard}};

}  // namespace

const Target& target(std::string_view name) {
  for (const Target& known : kTargets)
    if (known.name == name) return known;
  std::string names;
  for (const Target& known : kTargets) names.append(" ").append(known.name);
  throw std::invalid_argument(fmt::format("{}: unknown target; use one of{}", name, names));
}

void run(const Target& target, Bytes bytes) {
  try {
    target.read(bytes);
  } catch (const FormatError&) {
  } catch (const FileError&) {
  } catch (const std::invalid_argument&) {
  }
}

}  // namespace stageid::fuzz
