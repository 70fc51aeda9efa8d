#include "acquisition/slog/slog_scan.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <limits>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/slog/crc32c.hpp"

namespace stageid {

namespace {

constexpr std::size_t kScanBytes = std::size_t{1} << 18;

/// One step of a scan: collects blocks and damage.
class ScanStep {
 public:
  ScanStep(const SlogSource& source, SlogScanDepth depth, std::optional<std::uint32_t> log_id,
           std::uint64_t sequence)
      : source_(source), depth_(depth), log_id_(log_id), sequence_(sequence) {}

  SlogScan run(std::uint64_t& offset, std::size_t most, std::optional<LogDamage>& tail) {
    tail.reset();
    while (offset < source_.bytes() && scan_.blocks.size() < most) {
      std::string wrong;
      if (const auto block = block_at(offset, wrong)) {
        offset = take(*block);
        continue;
      }
      const std::uint64_t next = next_header(offset + 1);
      LogDamage damage{offset, next - offset, std::move(wrong)};
      if (next == source_.bytes()) {
        tail = std::move(damage);
        break;
      }
      scan_.damage.push_back(std::move(damage));
      offset = next;
    }
    if (!log_id_)
      throw FormatError(
          source_.path(), "",
          "contains no intact block of a native log (.slog); give a log written by 'stageid run'");
    scan_.log_id = *log_id_;
    if (scan_.blocks.size() == most) leave_jumps(offset);
    keep_those_in_order();
    report_missing();
    return std::move(scan_);
  }

 private:
  /// The block with its header at `offset`; otherwise nothing, with the reason in `wrong`.
  std::optional<SlogBlock> block_at(std::uint64_t offset, std::string& wrong) const {
    SlogBlock block{offset, {}};
    if (source_.bytes() - offset < sizeof block.header) {
      wrong = "the file ends within a block header";
      return std::nullopt;
    }
    source_.read(offset, &block.header, sizeof block.header);
    if (!slog_header_intact(block.header)) {
      wrong = "a block header is damaged";
      return std::nullopt;
    }
    if (block.header.version != kSlogVersion)
      fail_format(source_.path(), "",
                  "has unsupported format version {}; this program reads version {}",
                  block.header.version, kSlogVersion);
    if (log_id_ && block.header.log_id != *log_id_) {
      wrong = "a block belongs to another log";
      return std::nullopt;
    }
    if (block.header.payload_bytes > kSlogLargestPayload ||
        source_.bytes() - offset < slog_block_bytes(block.header)) {
      wrong = "the file ends within " + describe(block);
      return std::nullopt;
    }
    return block;
  }

  /// Records an intact header (and checks the payload if requested); returns the next offset.
  std::uint64_t take(const SlogBlock& block) {
    if (depth_ == SlogScanDepth::payloads && !payload_intact(source_, block))
      return skip_payload(block);
    if (!log_id_) log_id_ = block.header.log_id;
    scan_.blocks.push_back(block);
    return block.end();
  }

  /// Whether a last block that does not follow its predecessor is misplaced is seen from those behind it.
  void leave_jumps(std::uint64_t& offset) {
    auto& blocks = scan_.blocks;
    while (blocks.size() > 1 &&
           blocks.back().header.sequence != blocks[blocks.size() - 2].header.sequence + 1)
      blocks.pop_back();
    offset = blocks.back().end();
    std::erase_if(scan_.damage, [&](const LogDamage& d) { return d.offset >= offset; });
  }

  /// Keeps the longest list of blocks with increasing numbers: a misplaced one must not cost those around it.
  void keep_those_in_order() {
    std::vector<std::size_t> last;  // of a list of n + 1 blocks, with the lowest number
    std::vector<std::size_t> previous(scan_.blocks.size(), 0);
    const auto number = [this](std::size_t k) { return scan_.blocks[k].header.sequence; };
    for (std::size_t k = 0; k < scan_.blocks.size(); ++k) {
      if (number(k) < sequence_) continue;
      const auto place = std::lower_bound(
          last.begin(), last.end(), number(k),
          [&](std::size_t a, std::uint64_t sequence) { return number(a) < sequence; });
      if (place != last.begin()) previous[k] = *std::prev(place);
      if (place == last.end())
        last.push_back(k);
      else if (number(*place) != number(k))
        *place = k;
    }
    std::vector<bool> kept(scan_.blocks.size(), false);
    for (std::size_t n = last.size(), k = n > 0 ? last.back() : 0; n > 0; --n, k = previous[k])
      kept[k] = true;
    std::vector<SlogBlock> in_order;
    for (std::size_t k = 0; k < scan_.blocks.size(); ++k) {
      const SlogBlock& block = scan_.blocks[k];
      if (kept[k])
        in_order.push_back(block);
      else
        scan_.damage.push_back(
            {block.offset, slog_block_bytes(block.header), describe(block) + " is out of order"});
    }
    scan_.blocks = std::move(in_order);
  }

  /// Reports gaps in the numbers, except behind damage, which explains them.
  void report_missing() {
    std::set<std::uint64_t> damage_ends;
    for (const LogDamage& damage : scan_.damage) damage_ends.insert(damage.offset + damage.bytes);
    std::uint64_t next = sequence_;
    for (const SlogBlock& block : scan_.blocks) {
      if (block.header.sequence > next && !damage_ends.contains(block.offset))
        scan_.damage.push_back(
            {block.offset, 0,
             fmt::format("blocks {} to {} are missing", next, block.header.sequence - 1)});
      next = block.header.sequence + 1;
    }
    std::stable_sort(scan_.damage.begin(), scan_.damage.end(),
                     [](const LogDamage& a, const LogDamage& b) { return a.offset < b.offset; });
  }

  /// The length in an intact header is valid unless bytes were inserted or deleted after it.
  std::uint64_t skip_payload(const SlogBlock& block) {
    std::string ignored;
    const bool next_stands = block.end() == source_.bytes() ||
                             (block.end() < source_.bytes() && block_at(block.end(), ignored));
    const std::uint64_t next =
        next_stands ? block.end() : next_header(block.offset + kSlogAlignment);
    scan_.damage.push_back(
        {block.offset, next - block.offset, "the payload of " + describe(block) + " is damaged"});
    return next;
  }

  /// Offset of the next intact header of this log at or after `from`; otherwise the end of the file.
  std::uint64_t next_header(std::uint64_t from) const {
    const std::string_view magic(reinterpret_cast<const char*>(kSlogMagic.data()),
                                 kSlogMagic.size());
    std::vector<char> piece(kScanBytes);
    while (from + sizeof(SlogBlockHeader) <= source_.bytes()) {
      const auto size =
          static_cast<std::size_t>(std::min<std::uint64_t>(kScanBytes, source_.bytes() - from));
      source_.read(from, piece.data(), size);
      const std::string_view text(piece.data(), size);
      for (std::size_t at = text.find(magic); at != text.npos; at = text.find(magic, at + 1)) {
        std::string ignored;
        if (block_at(from + at, ignored)) return from + at;
      }
      if (size < kScanBytes) break;
      from += size - (magic.size() - 1);  // a magic may span two pieces
    }
    return source_.bytes();
  }

  const SlogSource& source_;
  SlogScanDepth depth_;
  std::optional<std::uint32_t> log_id_;
  std::uint64_t sequence_;  // of the first block
  SlogScan scan_;
};

}  // namespace

std::uint32_t slog_header_crc(const SlogBlockHeader& header) noexcept {
  const auto bytes = std::as_bytes(std::span(&header, 1));
  return crc32c(bytes.first(offsetof(SlogBlockHeader, header_crc)));
}

bool slog_header_intact(const SlogBlockHeader& header) noexcept {
  return header.magic == kSlogMagic && header.header_crc == slog_header_crc(header);
}

SlogSource::SlogSource(std::filesystem::path file) : path_(std::move(file)) {
  note_input(path_);
  file_ = FileDescriptor(::open(path_.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!file_ || ::fstat(file_.get(), &status) != 0)
    fail_file(path_, "cannot be opened: {}; check the path",
              std::error_code(errno, std::generic_category()).message());
  if (!S_ISREG(status.st_mode)) fail_file(path_, "is not a regular file; give a log file");
  bytes_ = static_cast<std::uint64_t>(status.st_size);
}

void SlogSource::update_bytes() {
  struct stat status {};
  if (::fstat(file_.get(), &status) != 0)
    fail_file(path_, "cannot be read: {}",
              std::error_code(errno, std::generic_category()).message());
  bytes_ = static_cast<std::uint64_t>(status.st_size);
}

void SlogSource::read(std::uint64_t offset, void* to, std::size_t size) const {
  auto* at = static_cast<std::byte*>(to);
  while (size > 0) {
    const ssize_t count = ::pread(file_.get(), at, size, static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0)
      fail_file(path_, "cannot be read at byte {}: {}", offset,
                count < 0 ? std::error_code(errno, std::generic_category()).message()
                          : std::string("the file was truncated while it was read"));
    at += count;
    offset += static_cast<std::uint64_t>(count);
    size -= static_cast<std::size_t>(count);
  }
}

void SlogSource::read_pieces(std::uint64_t from, std::uint64_t end, const Take& take) const {
  std::vector<std::byte> piece(std::min<std::uint64_t>(end - from, kScanBytes));
  while (from < end) {
    const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(end - from, piece.size()));
    read(from, piece.data(), size);
    take(std::span(piece).first(size));
    from += size;
  }
}

void SlogSource::advise(int advice) const noexcept {
  static_cast<void>(::posix_fadvise(file_.get(), 0, 0, advice));
}

SlogScan SlogScanner::next(const SlogSource& source, std::size_t most) {
  // One header every few hundred kB; then everything in order.
  if (depth_ == SlogScanDepth::headers) source.advise(POSIX_FADV_RANDOM);
  SlogScan scan = ScanStep(source, depth_, log_id_, sequence_).run(offset_, most, tail_);
  source.advise(POSIX_FADV_SEQUENTIAL);
  log_id_ = scan.log_id;
  if (!scan.blocks.empty()) sequence_ = scan.blocks.back().header.sequence + 1;
  return scan;
}

SlogScan scan_slog(const SlogSource& source, SlogScanDepth depth) {
  SlogScanner scanner(depth);
  SlogScan scan = scanner.next(source, std::numeric_limits<std::size_t>::max());
  if (scanner.tail()) scan.damage.push_back(*scanner.tail());
  return scan;
}

bool is_unwritten_slog(const std::filesystem::path& file) {
  const SlogSource source(file);
  SlogBlock first;  // what is not in the file is as if it were right
  source.read(0, &first.header, std::min<std::uint64_t>(source.bytes(), sizeof first.header));
  const auto there = std::as_bytes(std::span(first.header.magic))
                         .first(std::min<std::uint64_t>(source.bytes(), kSlogMagic.size()));
  const bool zero =
      std::all_of(there.begin(), there.end(), [](std::byte b) { return b == std::byte{}; });
  const bool begun = zero || first.header.magic == kSlogMagic;
  const bool whole = slog_header_intact(first.header) &&
                     (first.header.version != kSlogVersion || first.end() < source.bytes());
  if (!begun || whole) return false;
  try {
    scan_slog(source, SlogScanDepth::payloads);
    return false;
  } catch (const FormatError&) {
    return true;
  }
}

bool payload_intact(const SlogSource& source, const SlogBlock& block) {
  std::uint32_t crc = 0;
  source.read_pieces(block.payload_offset(), block.end(),
                     [&crc](std::span<const std::byte> piece) { crc = crc32c(piece, crc); });
  return crc == block.header.payload_crc;
}

std::vector<std::byte> read_payload(const SlogSource& source, const SlogBlock& block) {
  std::vector<std::byte> payload(slog_padded(block.header.payload_bytes));
  source.read(block.payload_offset(), payload.data(), payload.size());
  if (crc32c(payload) != block.header.payload_crc)
    throw FormatError(source.path(), "",
                      "the payload of " + describe(block) +
                          " is damaged; use 'stageid log recover' to copy the intact parts");
  payload.resize(block.header.payload_bytes);
  return payload;
}

std::string read_text(const SlogSource& source, const SlogBlock& block) {
  const std::vector<std::byte> payload = read_payload(source, block);
  return {reinterpret_cast<const char*>(payload.data()), payload.size()};
}

std::string describe(const SlogBlock& block) {
  return fmt::format("block {} ({}, byte {})", block.header.sequence,
                     to_string(static_cast<SlogBlockType>(block.header.type)), block.offset);
}

}  // namespace stageid
