#include "files/sealed_file.hpp"

#define XXH_INLINE_ALL
#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <vector>

#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

constexpr const char* first_line = "phyxel sealed file 1\n";

/// Incremental XXH3 digest.
class Digest {
 public:
  Digest() : state_(XXH3_createState()) { XXH3_128bits_reset(state_.get()); }
  void add(const void* bytes, std::size_t count) {
    XXH3_128bits_update(state_.get(), bytes, count);
  }
  std::string hex() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(state_.get());
    return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
  }

 private:
  struct Free {
    void operator()(XXH3_state_t* state) const { XXH3_freeState(state); }
  };
  std::unique_ptr<XXH3_state_t, Free> state_;
};

std::array<char, seal_size> seal_of(const std::string& kind, std::uint64_t bytes,
                                    const std::string& digest) {
  std::array<char, seal_size> seal;
  seal.fill('\n');
  const std::string text = fmt::format("{}kind       {}\nbytes      {}\nxxh3-128   {}\n",
                                       first_line, kind, bytes, digest);
  std::memcpy(seal.data(), text.data(), text.size());
  return seal;
}

/// Value of the seal's line that begins with `key`; "" if it is missing or not printable.
std::string line_of(const std::string& seal, const std::string& key) {
  const std::size_t at = seal.find('\n' + key + ' ');
  if (at == std::string::npos) return "";
  const std::size_t end = std::min(seal.size(), seal.find('\n', at + 1));
  const std::size_t begin = std::min(end, seal.find_first_not_of(' ', at + 1 + key.size()));
  const std::string value = seal.substr(begin, end - begin);
  const bool printable =
      std::all_of(value.begin(), value.end(), [](char c) { return c >= ' ' && c <= '~'; });
  return printable ? value : "";
}

/// Digest of the bytes behind the seal; `bytes` receives their number.
std::string digest_rest(std::istream& in, std::uint64_t* bytes) {
  std::vector<char> buffer(1 << 16);
  Digest digest;
  *bytes = 0;
  while (in.read(buffer.data(), static_cast<std::streamsize>(buffer.size())), in.gcount() > 0) {
    digest.add(buffer.data(), static_cast<std::size_t>(in.gcount()));
    *bytes += static_cast<std::uint64_t>(in.gcount());
  }
  return digest.hex();
}

/// Writes the layout and then the other pieces, which collective writers find through the layout.
void write_collectively(NewFile& out, const Content& content) {
  std::uint64_t at = seal_size;
  for (const Content::Piece& piece : content.pieces) {
    std::uint64_t end = at;
    if (piece.is_layout) {
      piece.produce([&](std::span<const std::byte> bytes) {
        out.write(end, bytes);
        end += bytes.size();
      });
    }
    at += piece.bytes;
  }
  out.sync();  // makes the layout visible on other hosts
  content.write_collectively(out.temporary());
}

/// Reads the seal of a file; the stream is then positioned behind it.
std::string read_seal(const fs::path& file, std::ifstream& in) {
  require_regular_file(file);
  in.open(file, std::ios::binary);
  if (!in) throw InputError(fmt::format("{}: cannot be read", file.string()));
  std::string seal(seal_size, '\0');
  in.read(seal.data(), seal_size);
  if (in.gcount() != static_cast<std::streamsize>(seal_size) || seal.rfind(first_line, 0) != 0) {
    const std::string start = seal.substr(0, 18);
    if (start == std::string(first_line).substr(0, 18) &&
        in.gcount() == static_cast<std::streamsize>(seal_size)) {
      throw InputError(
          fmt::format("{}: written by another version of phyxel: its first line is not \"{}\"",
                      file.string(), std::string(first_line).substr(0, 20)));
    }
    throw InputError(
        fmt::format("{}: not a file written by phyxel (or truncated within its first {} bytes)",
                    file.string(), seal_size));
  }
  return seal;
}

void check_bytes(const fs::path& file, const std::string& seal, std::uint64_t bytes) {
  const std::string stated = line_of(seal, "bytes");
  if (stated == std::to_string(bytes)) return;
  throw InputError(fmt::format("{}: truncated or altered: {} bytes behind the seal, which says {}",
                               file.string(), bytes, stated.empty() ? "nothing" : stated));
}

}  // namespace

void write_sealed(const fs::path& file, const std::string& kind, const Content& content,
                  Durable durable) {
  NewFile out(file, seal_size + content.size);
  if (content.write_collectively) write_collectively(out, content);
  Digest digest;
  std::uint64_t at = seal_size;
  const auto digested = [&](std::span<const std::byte> bytes) {
    digest.add(bytes.data(), bytes.size());
    at += bytes.size();
  };
  const auto written = [&](std::span<const std::byte> bytes) {
    out.write(at, bytes);
    digested(bytes);
  };
  for (const Content::Piece& piece : content.pieces) {
    if (piece.produce) {
      piece.produce(written);
    } else {
      out.read(at, piece.bytes, digested);
    }
  }
  const auto seal = seal_of(kind, content.size, digest.hex());
  out.write(0, std::as_bytes(std::span(seal)));
  out.finish(durable);
}

void seal_in_place(const fs::path& file, const std::string& kind) {
  std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
  stream.seekg(seal_size);
  std::uint64_t bytes = 0;
  const std::string digest = digest_rest(stream, &bytes);
  const auto seal = seal_of(kind, bytes, digest);
  stream.clear();
  stream.seekp(0);
  stream.write(seal.data(), seal.size());
  stream.close();
  if (!stream) throw OutputError(fmt::format("{}: cannot be written", file.string()));
}

void check_size(const fs::path& file) {
  std::ifstream in;
  const std::string seal = read_seal(file, in);
  check_bytes(file, seal, fs::file_size(file) - seal_size);
}

std::string check_seal(const fs::path& file) {
  std::ifstream in;
  const std::string seal = read_seal(file, in);
  std::uint64_t bytes = 0;
  const std::string digest = digest_rest(in, &bytes);
  check_bytes(file, seal, bytes);
  if (line_of(seal, "xxh3-128") != digest) {
    throw InputError(fmt::format(
        "{}: altered since it was written: its digest does not fit its content", file.string()));
  }
  std::string kind = line_of(seal, "kind");
  if (kind.empty()) {
    throw InputError(fmt::format("{}: its seal names no kind of file", file.string()));
  }
  return kind;
}

void check_seal(const fs::path& file, const std::string& kind) {
  const std::string found = check_seal(file);
  if (found != kind) {
    throw InputError(fmt::format("{}: is a phyxel {}; expected a {}", file.string(), found, kind));
  }
}

}  // namespace phyxel
