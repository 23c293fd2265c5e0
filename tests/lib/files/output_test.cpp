/// Files written and read by name: only regular files are replaced, planted links are not followed,
/// no call blocks, and durable data are flushed to the disk before they are renamed.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <fstream>

#include "files/atomic_file.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/scene.hpp"
#include "support/folder.hpp"

namespace {

/// System calls that change the disk, in their order.
std::vector<std::string>& disk_calls() {
  static std::vector<std::string> calls;
  return calls;
}

}  // namespace

// Replacements of the C library's functions in this program.
extern "C" int fsync(int fd) {
  struct stat status {};
  fstat(fd, &status);
  disk_calls().push_back(S_ISDIR(status.st_mode) ? "sync folder" : "sync file");
  return static_cast<int>(syscall(SYS_fsync, fd));
}
extern "C" int rename(const char* from, const char* to) noexcept {
  disk_calls().push_back("rename");
  return static_cast<int>(syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Outputs : public test::Folder {
 protected:
  static std::string refusal(const std::function<void()>& work) {
    try {
      work();
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }
  fs::path fifo() const {
    const fs::path file = folder_ / "fifo";
    EXPECT_EQ(mkfifo(file.c_str(), 0600), 0);
    return file;
  }
};

TEST_F(Outputs, AreOnTheDiskBeforeTheirNameIs) {
  disk_calls().clear();
  write_whole_file(folder_ / "lasting", "text", Durable::yes);
  EXPECT_THAT(disk_calls(), ElementsAre("sync file", "rename", "sync folder"));
}

/// A file that is abandoned because of an unrelated exception.
TEST_F(Outputs, GivenUpLeaveTheOldFileAndNothingElse) {
  const auto open_files = [] {
    return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
  };
  write("kept", "old");
  const auto before = open_files();
  {
    NewFile file(folder_ / "kept", 3);
    file.write(0, std::as_bytes(std::span("new", 3)));
    EXPECT_TRUE(fs::exists(file.temporary()));
  }
  EXPECT_EQ(open_files(), before);
  EXPECT_EQ(text_of(folder_ / "kept"), "old");
  EXPECT_FALSE(fs::exists(folder_ / "kept.tmp"));
  // What is finished is no more touched, also if another begins meanwhile.
  NewFile next(folder_ / "next", 3);
  {
    NewFile file(folder_ / "kept", 3);
    file.write(0, std::as_bytes(std::span("new", 3)));
    file.finish(Durable::no);
    write("kept.tmp", "another's");
  }
  EXPECT_EQ(open_files(), before + 1);
  EXPECT_EQ(text_of(folder_ / "kept"), "new");
  EXPECT_EQ(text_of(folder_ / "kept.tmp"), "another's");
}

TEST_F(Outputs, ReplaceRegularFilesOnly) {
  const fs::path pipe = fifo();
  Cloud cloud;
  cloud.position = {{0, 0, 0}};
  EXPECT_THAT(refusal([&] { write_body(pipe, cloud, true); }), HasSubstr("fifo: is a FIFO"));
  EXPECT_TRUE(fs::is_fifo(pipe));
  const fs::path device = folder_ / "null";
  if (mknod(device.c_str(), S_IFCHR | 0666, dev_t{1 << 8 | 3}) == 0) {
    EXPECT_THAT(refusal([&] { write_body(device, cloud, true); }), HasSubstr("a character device"));
    write_whole_file(device, "text", Durable::no);
    EXPECT_TRUE(fs::is_character_file(device));
  }
  EXPECT_THAT(refusal([&] { write_whole_file(folder_, "text", Durable::no); }),
              HasSubstr("is a folder"));
}

TEST_F(Outputs, GoThroughAFifo) {
  const fs::path pipe = fifo();
  const int reader = open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
  EXPECT_NO_THROW(check_output_file(pipe, false, Output::file_or_stream));
  write_whole_file(pipe, "a table", Durable::no);
  char text[20] = {};
  EXPECT_EQ(read(reader, text, sizeof text), 7);
  EXPECT_STREQ(text, "a table");
  close(reader);
  EXPECT_TRUE(fs::is_fifo(pipe));
}

TEST_F(Outputs, FollowALinkToItsFileAndRefuseOneThatLeadsNowhere) {
  write("target", "old");
  fs::create_symlink("target", folder_ / "link");
  write_whole_file(folder_ / "link", "new", Durable::no);
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(text_of(folder_ / "target"), "new");
  fs::create_symlink("nowhere", folder_ / "dangling");
  EXPECT_THAT(refusal([&] { write_whole_file(folder_ / "dangling", "x", Durable::no); }),
              HasSubstr("a dangling link"));
  EXPECT_FALSE(fs::exists(folder_ / "nowhere"));
}

TEST_F(Outputs, PlantedLinksAreNotFollowed) {
  write("precious", "kept");
  fs::create_symlink("precious", folder_ / "table.csv.tmp");
  write_whole_file(folder_ / "table.csv", "new", Durable::no);
  EXPECT_EQ(text_of(folder_ / "precious"), "kept");
  EXPECT_EQ(text_of(folder_ / "table.csv"), "new");
  EXPECT_FALSE(fs::is_symlink(folder_ / "table.csv"));
}

TEST_F(Outputs, AFailedTailLeavesTheOldOne) {
  const std::string old(3000, 'o');
  const fs::path log = write("log.csv", "head\n" + old);
  auto* const handler = signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit{4000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  EXPECT_THROW(replace_tail(log, 5, std::string(5000, 'n')), OutputError);
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, handler);
  EXPECT_TRUE(text_of(log) == "head\n" + old);
}

/// A reader of a FIFO waits for a writer that never comes.
TEST_F(Outputs, InputsThatAreNoFilesAreRefusedAtOnce) {
  const fs::path pipe = fifo();
  const auto refused = [&](const std::function<void()>& read) {
    EXPECT_THAT(refusal(read), HasSubstr("fifo: is a FIFO"));
  };
  refused([&] { read_scene(pipe); });
  refused([&] { read_body(pipe); });
  refused([&] { read_checkpoint(pipe); });
  refused([&] { read_text_file(pipe, 100); });
  fs::create_symlink("fifo", folder_ / "mesh.obj");
  EXPECT_THAT(refusal([&] { read_mesh(folder_ / "mesh.obj"); }), HasSubstr("is a FIFO"));
}

}  // namespace
}  // namespace phyxel
