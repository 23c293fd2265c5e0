#include "files/hdf5_layout.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <optional>
#include <set>
#include <span>
#include <string_view>

#include "files/sealed_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

// Sealed files are little-endian, and are read without conversion.
static_assert(std::endian::native == std::endian::little);

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint64_t undefined = ~std::uint64_t{0};
// Largest block of the structure, far above what phyxel writes: the headers of a frame take some
// kilobytes, and the names of a body's regions are in one block.
constexpr std::uint64_t largest_block = std::uint64_t{64} << 20;
constexpr int deepest_group = 8, highest_tree = 8;

/// The message types that object headers may hold.
enum Message : std::uint16_t {
  nothing = 0x00,
  dataspace = 0x01,
  datatype = 0x03,
  old_fill_value = 0x04,
  fill_value = 0x05,
  layout = 0x08,
  attribute = 0x0c,
  continuation = 0x10,
  symbol_table = 0x11,
  modification_time = 0x12,
};

/// A number type that is allowed, as a datatype message encodes it.
struct NumberType {
  Hdf5Value::Kind kind;
  std::uint64_t width;
  std::string_view message;
};
using namespace std::string_view_literals;
constexpr NumberType number_types[] = {
    {Hdf5Value::Kind::real, 4, "\x11\x20\x1f\0\4\0\0\0\0\0\x20\0\x17\x08\0\x17\x7f\0\0\0"sv},
    {Hdf5Value::Kind::real, 8, "\x11\x20\x3f\0\x08\0\0\0\0\0\x40\0\x34\x0b\0\x34\xff\3\0\0"sv},
    {Hdf5Value::Kind::integer, 1, "\x10\0\0\0\1\0\0\0\0\0\x08\0"sv},
    {Hdf5Value::Kind::integer, 4, "\x10\x08\0\0\4\0\0\0\0\0\x20\0"sv},
    {Hdf5Value::Kind::integer, 8, "\x10\x08\0\0\x08\0\0\0\0\0\x40\0"sv},
};
constexpr std::uint8_t text_class = 0x13;

std::uint64_t rounded_up(std::uint64_t bytes) { return (bytes + 7) / 8 * 8; }

/// Sequential reader of the numbers of a block.
class Cursor {
 public:
  Cursor(const FileBytes& file, std::span<const std::uint8_t> bytes) : file_(file), bytes_(bytes) {}

  std::uint64_t left() const { return bytes_.size(); }
  std::span<const std::uint8_t> take(std::uint64_t count) {
    if (count > bytes_.size()) file_.refuse("its HDF5 structure is truncated");
    const auto taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  std::uint64_t number(std::size_t width) {
    std::uint64_t value = 0;
    std::memcpy(&value, take(width).data(), width);
    return value;
  }
  void expect(std::string_view signature) {
    const auto found = take(signature.size());
    if (std::memcmp(found.data(), signature.data(), signature.size()) != 0) {
      file_.refuse("its HDF5 structure is not one that phyxel writes");
    }
  }

 private:
  const FileBytes& file_;
  std::span<const std::uint8_t> bytes_;
};

class LayoutReader {
 public:
  explicit LayoutReader(const FileBytes& file) : file_(file), unclaimed_(file.size()) {}

  std::map<std::string, Hdf5Object> read() {
    const Bytes superblock = block(0, 96);
    Cursor at(file_, superblock);
    at.expect(
        "\x89HDF\r\n\x1a\n\0\0\0\0\0\x08\x08\0"sv);  // versions 0; offsets, lengths of 8 bytes
    at.take(8);                                      // sizes of nodes, flags
    // The base address is 0 in files written in memory, and 512 in files written behind a seal.
    if (const std::uint64_t base = at.number(8); base != 0 && base != seal_size) {
      file_.refuse(fmt::format("its HDF5 structure begins at {}; allowed: {}", base, seal_size));
    }
    at.take(8 + 8 + 8 + 8);  // free space, end, driver, name of the root
    read_object("", at.number(8), 0);
    return std::move(objects_);
  }

 private:
  /// Offset in the file of a block at an address. @throws InputError if the block exceeds the file,
  /// or overlaps one claimed before
  std::uint64_t claim(std::uint64_t address, std::uint64_t bytes) {
    const std::uint64_t most = file_.size() - std::min<std::uint64_t>(seal_size, file_.size());
    if (address > most || bytes > most - address || bytes > unclaimed_) {
      file_.refuse(fmt::format("its HDF5 structure claims {} bytes at {}, more than the file holds",
                               bytes, address));
    }
    unclaimed_ -= bytes;
    return address + seal_size;
  }

  Bytes block(std::uint64_t address, std::uint64_t bytes) {
    const std::uint64_t at = claim(address, bytes);
    if (bytes > largest_block) {
      file_.refuse(fmt::format("its HDF5 structure has a block of {} bytes; allowed at most {}",
                               bytes, largest_block));
    }
    Bytes found(bytes);
    file_.read(at, bytes, found.data());
    return found;
  }

  /// A message of an object header or an attribute.
  struct Part {
    std::uint16_t type;
    Bytes bytes;
    std::uint64_t at;  // offset in the file
  };

  /// Messages of an object header of version 1 and of its continuation blocks.
  std::vector<Part> messages_of(std::uint64_t address, const std::string& path) {
    const Bytes head = block(address, 16);
    Cursor at(file_, head);
    at.expect("\1\0"sv);
    const std::uint64_t count = at.number(2);
    at.take(4);  // references
    struct Stretch {
      std::uint64_t address, bytes;
    };
    std::vector<Stretch> stretches{{address + 16, at.number(4)}};
    std::vector<Part> parts;
    for (std::size_t s = 0; s < stretches.size(); ++s) {
      const Stretch stretch = stretches[s];
      const Bytes bytes = block(stretch.address, stretch.bytes);
      Cursor in(file_, bytes);
      while (in.left() >= 8 && parts.size() < count) {
        const auto type = static_cast<std::uint16_t>(in.number(2));
        const std::uint64_t size = in.number(2), flags = in.number(1);
        in.take(3);
        if ((flags & 2) != 0) file_.refuse(path + " has a shared HDF5 message; allowed: none");
        const std::uint64_t place = stretch.address + seal_size + bytes.size() - in.left();
        const auto content = in.take(size);
        parts.push_back({type, Bytes(content.begin(), content.end()), place});
        if (type != continuation) continue;
        Cursor next(file_, content);
        const std::uint64_t where = next.number(8);
        stretches.push_back({where, next.number(8)});
      }
    }
    return parts;
  }

  void read_object(const std::string& path, std::uint64_t address, int depth) {
    if (!visited_.insert(address).second) file_.refuse(path + " is in the file twice");
    Hdf5Object object;
    std::optional<std::pair<std::uint64_t, std::uint64_t>> members;  // tree and heap
    bool has_type = false, has_space = false;
    std::optional<std::uint64_t> stored;
    for (const Part& part : messages_of(address, path)) {
      Cursor in(file_, part.bytes);
      switch (part.type) {
        case nothing:
        case old_fill_value:
        case fill_value:
        case continuation:
        case modification_time:
          break;
        case dataspace:
          read_space(in, path, object.value);
          has_space = true;
          break;
        case datatype:
          read_type(in, path, object.value);
          has_type = true;
          break;
        case layout:
          in.expect("\3\1"sv);  // contiguous
          object.value.at = in.number(8);
          stored = in.number(8);
          break;
        case attribute:
          read_attribute(part, path, object);
          break;
        case symbol_table: {
          const std::uint64_t tree = in.number(8);
          members = {tree, in.number(8)};
          break;
        }
        default:
          file_.refuse(
              fmt::format("{} has an HDF5 message of type {:#x}, which phyxel never writes",
                          path.empty() ? "/" : path, part.type));
      }
    }
    object.is_group = members.has_value();
    if (object.is_group == (has_type || has_space || stored)) {
      file_.refuse(path + " is neither a group nor an array");
    }
    if (!object.is_group) {
      if (!has_type || !has_space || !stored) {
        file_.refuse(path + " is not stored as one contiguous block");
      }
      place_array(path, object.value, *stored);
    }
    objects_.emplace(path, std::move(object));
    if (members) read_group(path, members->first, members->second, depth);
  }

  void place_array(const std::string& path, Hdf5Value& value, std::uint64_t stored) {
    const std::uint64_t bytes = bytes_of(path, value);
    if (bytes != stored) {
      file_.refuse(fmt::format("{} claims {} entries of {} bytes, but stores {} bytes", path,
                               value.count(), value.width, stored));
    }
    value.at = bytes == 0 ? 0 : claim(value.at, bytes);
  }

  /// Size of a value [bytes]. @throws InputError if it exceeds the file's size
  std::uint64_t bytes_of(const std::string& path, const Hdf5Value& value) const {
    std::uint64_t bytes = value.width;
    for (const std::uint64_t extent : value.extent) {
      if (extent > 0 && bytes > file_.size() / extent) {
        file_.refuse(fmt::format("{} claims {} entries of {} bytes, more than the file holds", path,
                                 fmt::join(value.extent, " x "), value.width));
      }
      bytes *= extent;
    }
    return bytes;
  }

  void read_space(Cursor& in, const std::string& path, Hdf5Value& value) const {
    const std::uint64_t version = in.number(1), rank = in.number(1), flags = in.number(1);
    in.take(5);
    if (version != 1 || flags > 1 || rank > 2) {
      file_.refuse(fmt::format("{} has {} dimensions; expected 1 or 2", path, rank));
    }
    value.extent.clear();
    for (std::uint64_t k = 0; k < rank; ++k) value.extent.push_back(in.number(8));
  }

  void read_type(Cursor& in, const std::string& path, Hdf5Value& value) const {
    const auto head = in.take(8);
    const std::string_view found(reinterpret_cast<const char*>(head.data()), head.size());
    if (head[0] == text_class) {
      std::uint32_t width = 0;
      std::memcpy(&width, head.data() + 4, sizeof width);
      value.kind = Hdf5Value::Kind::text;
      value.width = width;
      if (width > 0) return;
    }
    for (const NumberType& type : number_types) {
      if (!type.message.starts_with(found)) continue;
      in.expect(type.message.substr(head.size()));
      value.kind = type.kind;
      value.width = type.width;
      return;
    }
    file_.refuse(path +
                 " is neither a text of fixed length nor of float, double, 32-bit or 64-bit "
                 "integers, or bytes");
  }

  void read_attribute(const Part& part, const std::string& path, Hdf5Object& object) const {
    Cursor in(file_, part.bytes);
    in.expect("\1\0"sv);
    const std::uint64_t name_size = in.number(2), type_size = in.number(2),
                        space_size = in.number(2);
    const auto name = in.take(rounded_up(name_size)).first(name_size);
    const std::string text(name.begin(), std::find(name.begin(), name.end(), 0));
    const std::string called = fmt::format("the attribute {} of {}", text, path);
    Cursor type(file_, in.take(rounded_up(type_size)));
    Cursor space(file_, in.take(rounded_up(space_size)));
    Hdf5Value value;
    read_type(type, called, value);
    read_space(space, called, value);
    value.at = part.at + part.bytes.size() - in.left();
    if (bytes_of(called, value) > in.left()) file_.refuse(called + " is truncated");
    if (!object.attributes.emplace(text, std::move(value)).second) {
      file_.refuse(called + " is there twice");
    }
  }

  void read_group(const std::string& path, std::uint64_t tree, std::uint64_t heap, int depth) {
    if (depth >= deepest_group) {
      file_.refuse(fmt::format("{} is nested deeper than {} groups", path, deepest_group));
    }
    const Bytes head = block(heap, 32);
    Cursor at(file_, head);
    at.expect("HEAP\0\0\0\0"sv);
    const std::uint64_t size = at.number(8);
    at.take(8);  // free list
    const Bytes names = block(at.number(8), size);
    read_tree(path, tree, names, depth, -1);
  }

  /// Reads a node of the tree of a group's members.
  /// @param level the node's expected level; -1 for the root
  void read_tree(const std::string& path, std::uint64_t node, const Bytes& names, int depth,
                 int level) {
    const Bytes head = block(node, 24);
    Cursor at(file_, head);
    at.expect("TREE\0"sv);
    const auto found = static_cast<int>(at.number(1));
    const std::uint64_t count = at.number(2);
    if (found > highest_tree || (level >= 0 && found != level)) {
      file_.refuse(fmt::format("the members of {} are not a tree", path));
    }
    const Bytes children = block(node + 24, 16 * count);
    Cursor in(file_, children);
    for (std::uint64_t k = 0; k < count; ++k) {
      in.take(8);  // key
      const std::uint64_t child = in.number(8);
      if (found > 0) {
        read_tree(path, child, names, depth, found - 1);
      } else {
        read_members(path, child, names, depth);
      }
    }
  }

  void read_members(const std::string& path, std::uint64_t node, const Bytes& names, int depth) {
    const Bytes head = block(node, 8);
    Cursor at(file_, head);
    at.expect("SNOD\1\0"sv);
    const std::uint64_t count = at.number(2);
    const Bytes entries = block(node + 8, 40 * count);
    Cursor in(file_, entries);
    for (std::uint64_t k = 0; k < count; ++k) {
      const std::uint64_t name_at = in.number(8), address = in.number(8), cached = in.number(4);
      in.take(20);
      if (cached > 1) file_.refuse(path + " has a soft link; allowed: none");
      if (name_at >= names.size()) file_.refuse(path + " has a member without a name");
      const auto begin = names.begin() + static_cast<std::ptrdiff_t>(name_at);
      const auto end = std::find(begin, names.end(), 0);
      const std::string name(begin, end);
      if (end == names.end() || name.empty() || name == "." || name.find('/') != name.npos) {
        file_.refuse(path + " has a member without a proper name");
      }
      const std::string member = fmt::format("{}/{}", path, name);
      if (objects_.count(member) > 0) file_.refuse(member + " is in the file twice");
      read_object(member, address, depth + 1);
    }
  }

  const FileBytes& file_;
  std::uint64_t unclaimed_;  // bytes
  std::set<std::uint64_t> visited_;
  std::map<std::string, Hdf5Object> objects_;
};

}  // namespace

FileBytes::FileBytes(std::string name) : name_(std::move(name)) {
  file_ = open(name_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat status {};
  if (file_ < 0 || fstat(file_, &status) != 0 || !S_ISREG(status.st_mode)) {
    if (file_ >= 0) close(file_);
    refuse("cannot be read as a file");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

FileBytes::~FileBytes() { close(file_); }

void FileBytes::read(std::uint64_t at, std::uint64_t count, void* to) const {
  auto* next = static_cast<char*>(to);
  while (count > 0) {
    const ssize_t got = pread(file_, next, count, static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) refuse("cannot be read to its end");
    next += got;
    at += static_cast<std::uint64_t>(got);
    count -= static_cast<std::uint64_t>(got);
  }
}

void FileBytes::refuse(const std::string& why) const {
  throw InputError(fmt::format("{}: {}", name_, why));
}

std::uint64_t Hdf5Value::count() const {
  std::uint64_t product = 1;
  for (const std::uint64_t part : extent) product *= part;
  return product;
}

std::map<std::string, Hdf5Object> read_hdf5_layout(const FileBytes& file) {
  return LayoutReader(file).read();
}

}  // namespace phyxel
