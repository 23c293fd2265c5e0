/// Crafted files with a valid digest: no content makes the readers crash, hang or allocate without
/// limit, and refusals name the fault.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"
#include "support/folder.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using ::testing::HasSubstr;

/// The message of the InputError that `call` throws, or "" if it throws none. Others pass.
std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

class HostileFiles : public test::Folder {
 protected:
  /// A file of a kind with a valid digest.
  fs::path sealed(const std::string& name, const std::string& kind,
                  const std::string& content) const {
    const fs::path file = write(name, std::string(seal_size, '\n') + content);
    seal_in_place(file, kind);
    return file;
  }
  /// The content of a file behind its seal.
  static std::string content_of(const fs::path& file) { return text_of(file).substr(seal_size); }

  std::string body_content() const {
    Cloud cloud;
    cloud.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    cloud.volume = {1, 2, 3, 4};
    cloud.surface = {cloud.position, {{0, 0, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}}};
    cloud.regions = {{"mouth", {0, 2}}, {"x-", {1}}};
    write_body(folder_ / "body.h5", cloud, true);
    return content_of(folder_ / "body.h5");
  }
};

/// Old HDF5 libraries read beyond their buffers for some of these files, and do not terminate for
/// others.
TEST_F(HostileFiles, EveryFieldMayHoldAnythingBehindARightDigest) {
  const std::string good = body_content();
  const fs::path file = folder_ / "crafted.h5";
  const std::uint64_t values[] = {0, 1, ~std::uint64_t{0}, 0x7fffffffffffffff, 96, 0xffff};
  int refused = 0, read = 0;
  for (std::size_t at = 0; at + 8 <= good.size(); at += 8) {
    const std::uint64_t value = values[at / 8 % std::size(values)];
    for (const std::size_t width : {std::size_t{2}, std::size_t{8}}) {
      std::string bad = good;
      std::memcpy(bad.data() + at, &value, width);
      const std::string message = refusal([&] { read_body(sealed("crafted.h5", "body", bad)); });
      if (message.empty()) {
        ++read;
      } else {
        EXPECT_EQ(message.rfind(file.string() + ": ", 0), 0u) << message;
        ++refused;
      }
    }
  }
  // Most bytes of so small a file are free space of groups, which is not read.
  EXPECT_GT(refused, 200);
  EXPECT_GT(read, 200);
}

TEST_F(HostileFiles, EveryCutIsRefused) {
  const std::string good = body_content();
  for (std::size_t size = 0; size < good.size(); size += 61) {
    EXPECT_NE(refusal([&] { read_body(sealed("cut.h5", "body", good.substr(0, size))); }), "")
        << size;
  }
}

/// A claim of 4e18 numbers in a file of a few kilobytes must not allocate memory.
TEST_F(HostileFiles, ClaimsBeyondTheFileTakeNoMemory) {
  std::string bad = body_content();
  const auto put = [&](std::string from, const std::string& to) {
    const std::size_t at = bad.find(from);
    ASSERT_NE(at, std::string::npos);
    bad.replace(at, to.size(), to);
  };
  // The extent of /volume: dataspace of version 1 with one dimension of 4, its largest too.
  const std::string four("\4\0\0\0\0\0\0\0", 8), head("\1\1\1\0\0\0\0\0", 8);
  put(head + four + four, head + std::string("\0\0\0\0\0\0\0\x38", 8));
  EXPECT_THAT(refusal([&] { read_body(sealed("large.h5", "body", bad)); }),
              HasSubstr("more than the file holds"));
}

TEST_F(HostileFiles, CraftedSealsAreRefusedByName) {
  const std::string content = body_content();
  const std::string seal = text_of(folder_ / "body.h5").substr(0, seal_size);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = seal;
    text.replace(text.find(from), from.size(), to);
    text.resize(seal_size, '\n');
    return text;
  };
  const std::string first = "phyxel sealed file 1\n";
  const std::string seals[] = {
      with("body", "    "),
      with("body\n", std::string(1, '\0') + "\n"),
      with("body", "\033[2J"),
      with("body", "b\xff\xfe"),
      with("kind       body\n", ""),
      with("\nxxh3-128", " xxh3-128"),
      with("xxh3-128   ", "xxh3-128\t"),
      first + std::string(seal_size - first.size(), ' '),
      first + "kind" + std::string(seal_size - first.size() - 4, ' '),
      first + "kind " + std::string(seal_size - first.size() - 5, 'x'),
      first + "bytes" + std::string(seal_size - first.size() - 5, ' '),
      first + std::string(seal_size - first.size() - 6, '\n') + "\nkind ",
      first + std::string(seal_size - first.size(), '\0'),
  };
  for (const std::string& text : seals) {
    ASSERT_EQ(text.size(), seal_size);
    const fs::path file = write("crafted.h5", text + content);
    const std::string message = refusal([&] { read_body(file); });
    EXPECT_EQ(message.rfind(file.string() + ": ", 0), 0u) << message << "\n" << text;
    for (const char c : message) EXPECT_TRUE(c >= ' ' && c <= '~') << message;
  }
}

TEST_F(HostileFiles, NoNewestCheckpointBlocksTheOlder) {
  State state;
  state.displacement = state.velocity = {{1, 2, 3}, {4, 5, 6}};
  state.step = 1;
  state.dt = 1;
  const fs::path older = write_checkpoint(folder_, state, {.precision = Precision::double_});
  const std::string good = content_of(older);
  const fs::path newer = folder_ / "checkpoint_000000002.h5";
  std::string not_finite = good;
  const double value = 6, nan = std::numeric_limits<double>::quiet_NaN();
  const std::size_t at =
      not_finite.rfind(std::string(reinterpret_cast<const char*>(&value), sizeof value));
  ASSERT_NE(at, std::string::npos);
  std::memcpy(not_finite.data() + at, &nan, sizeof nan);
  const struct {
    std::string name, message;
    std::function<void()> write_newer;
  } cases[] = {
      {"a seal of blanks", "bytes behind the seal",
       [&] {
         write(newer.filename(),
               "phyxel sealed file 1\nkind " + std::string(seal_size - 26, ' ') + good);
       }},
      {"another kind", "is a phyxel body", [&] { sealed(newer.filename(), "body", good); }},
      {"no HDF5", "HDF5 structure",
       [&] { sealed(newer.filename(), "checkpoint", std::string(4000, 'x')); }},
      {"half of it", "more than the file holds",
       [&] { sealed(newer.filename(), "checkpoint", good.substr(0, good.size() / 2)); }},
      {"a value", "not finite", [&] { sealed(newer.filename(), "checkpoint", not_finite); }},
  };
  for (const auto& c : cases) {
    c.write_newer();
    std::string warning;
    EXPECT_EQ(latest_checkpoint(folder_, &warning), older) << c.name;
    EXPECT_THAT(warning, HasSubstr(newer.string())) << c.name;
    EXPECT_THAT(warning, HasSubstr(c.message)) << c.name;
  }
  state.step = 2;
  write_checkpoint(folder_, state, {.precision = Precision::double_});
  EXPECT_EQ(latest_checkpoint(folder_), newer);
}

TEST_F(HostileFiles, CountsBeyondCountingAreRefused) {
  State state;
  state.displacement = state.velocity = {{1, 2, 3}};
  state.dt = 1;
  state.step = std::numeric_limits<std::int64_t>::max();
  const fs::path file = write_checkpoint(folder_, state, {});
  EXPECT_THAT(refusal([&] { read_checkpoint(file); }), HasSubstr("9223372036854775807 steps"));
}

/// More members than one node of a group's tree holds, and names that fill a heap.
TEST_F(HostileFiles, ManyRegionsComeBack) {
  Cloud cloud;
  cloud.position = {{0, 0, 0}, {1, 0, 0}};
  for (int k = 0; k < 700; ++k) cloud.regions["region of many letters " + std::to_string(k)] = {1};
  write_body(folder_ / "many.h5", cloud, false);
  EXPECT_EQ(read_body(folder_ / "many.h5").regions, cloud.regions);
}

/// Names that are not path components, which would hide a member or lead elsewhere.
TEST_F(HostileFiles, MembersHaveProperNames) {
  const std::string good = body_content();
  const std::size_t at = good.find("mouth");
  ASSERT_NE(at, std::string::npos);
  ASSERT_EQ(good.find("mouth", at + 1), std::string::npos);
  for (const std::string& name :
       {std::string("m/uth"), std::string("/"), std::string("."), std::string()}) {
    std::string bad = good;
    bad.replace(at, 5, name + std::string(5 - name.size(), '\0'));
    EXPECT_THAT(refusal([&] { read_body(sealed("named.h5", "body", bad)); }),
                HasSubstr("member without a proper name"))
        << name;
  }
}

/// Features of HDF5 that phyxel does not use.
TEST_F(HostileFiles, OtherPartsOfHdf5AreRefused) {
  using Make = std::function<void(hid_t)>;
  const auto array = [](hid_t file, hid_t type, hid_t properties) {
    const hsize_t extent[] = {4, 4};
    const hid_t space = H5Screate_simple(2, extent, nullptr);
    H5Dclose(H5Dcreate2(file, "/a", type, space, H5P_DEFAULT, properties, H5P_DEFAULT));
    H5Sclose(space);
  };
  const auto chunked = [] {
    const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk[] = {2, 2};
    H5Pset_chunk(properties, 2, chunk);
    return properties;
  };
  const struct {
    const char* what;
    bool latest;
    Make make;
  } cases[] = {
      {"chunks", false, [&](hid_t f) { array(f, H5T_NATIVE_DOUBLE, chunked()); }},
      {"a filter", false,
       [&](hid_t f) {
         const hid_t properties = chunked();
         H5Pset_shuffle(properties);
         array(f, H5T_NATIVE_DOUBLE, properties);
       }},
      {"compact storage", false,
       [&](hid_t f) {
         const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
         H5Pset_layout(properties, H5D_COMPACT);
         array(f, H5T_NATIVE_DOUBLE, properties);
       }},
      {"an external file", false,
       [&](hid_t f) {
         const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
         H5Pset_external(properties, "/etc/passwd", 0, H5F_UNLIMITED);
         array(f, H5T_NATIVE_DOUBLE, properties);
       }},
      {"16-bit numbers", false, [&](hid_t f) { array(f, H5T_NATIVE_INT16, H5P_DEFAULT); }},
      {"big-endian numbers", false, [&](hid_t f) { array(f, H5T_IEEE_F64BE, H5P_DEFAULT); }},
      {"a soft link", false,
       [](hid_t f) { H5Lcreate_soft("/b", f, "/a", H5P_DEFAULT, H5P_DEFAULT); }},
      {"an external link", false,
       [](hid_t f) { H5Lcreate_external("/etc/passwd", "/b", f, "/a", H5P_DEFAULT, H5P_DEFAULT); }},
      {"a group in itself", false,
       [](hid_t f) { H5Lcreate_hard(f, "/", f, "/a", H5P_DEFAULT, H5P_DEFAULT); }},
      {"a newer format", true, [&](hid_t f) { array(f, H5T_NATIVE_DOUBLE, H5P_DEFAULT); }},
  };
  for (const auto& c : cases) {
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    if (c.latest) H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
    const hid_t creation = H5Pcreate(H5P_FILE_CREATE);
    H5Pset_userblock(creation, seal_size);
    const fs::path file = folder_ / "other.h5";
    const hid_t made = H5Fcreate(file.c_str(), H5F_ACC_TRUNC, creation, access);
    ASSERT_GE(made, 0);
    c.make(made);
    ASSERT_GE(H5Fclose(made), 0);
    seal_in_place(file, "body");
    EXPECT_NE(refusal([&] { Hdf5Reader reader(file); }), "") << c.what;
  }
}

/// Numbers are equal to those that HDF5 reads, in each type and each conversion.
TEST_F(HostileFiles, NumbersAreThoseOfHdf5) {
  Hdf5Writer out;
  const std::vector<double> reals{0, -1.5, 1e-300, 1e300, std::nextafter(1.0, 2.0), 0.1};
  const std::vector<std::int64_t> integers{0, -1, 2147483647, -2147483647 - 1, 255};
  out.array<double>("/d", reals, 3);
  out.array<float>("/f", std::vector<float>(reals.begin(), reals.end()));
  out.array<std::int64_t>("/l", integers);
  out.array<std::int32_t>("/i", std::vector<std::int32_t>(integers.begin(), integers.end()));
  out.array<std::uint8_t>("/b", std::vector<std::uint8_t>{0, 128, 255});
  out.array<std::int64_t>("/beyond", std::vector<std::int64_t>{std::int64_t{1} << 40});
  const fs::path file = folder_ / "numbers.h5";
  write_sealed(file, "body", out.content(), Durable::no);
  const Hdf5Reader in(file);
  const hid_t opened = H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  ASSERT_GE(opened, 0);
  const auto expect_same = [&]<class T>(const char* path, hid_t type, const std::vector<T>& found) {
    std::vector<T> expected(found.size());
    const hid_t array = H5Dopen2(opened, path, H5P_DEFAULT);
    ASSERT_GE(H5Dread(array, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, expected.data()), 0);
    H5Dclose(array);
    EXPECT_EQ(found, expected) << path;
  };
  expect_same("/d", H5T_NATIVE_DOUBLE, in.array<double>("/d", 3));
  expect_same("/d", H5T_NATIVE_FLOAT, in.array<float>("/d", 3));
  expect_same("/f", H5T_NATIVE_DOUBLE, in.array<double>("/f"));
  expect_same("/f", H5T_NATIVE_FLOAT, in.array<float>("/f"));
  expect_same("/l", H5T_NATIVE_INT64, in.array<std::int64_t>("/l"));
  expect_same("/l", H5T_NATIVE_INT32, in.array<std::int32_t>("/l"));
  expect_same("/i", H5T_NATIVE_INT64, in.array<std::int64_t>("/i"));
  expect_same("/b", H5T_NATIVE_UINT8, in.array<std::uint8_t>("/b"));
  H5Fclose(opened);
  EXPECT_THAT(refusal([&] { in.array<Index>("/beyond"); }), HasSubstr("beyond 32 bits"));
}

}  // namespace
}  // namespace phyxel
