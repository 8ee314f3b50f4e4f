#include "lcmtypes/link/file_sync.h"

#include <cerrno>
#include <filesystem>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>

namespace vantage {
namespace {

constexpr int kNoFile = 1'000'000;  // a descriptor that nobody has open

TEST(FileSync, AFileThatCannotBeWrittenThroughIsTold) {
  FileSync sync(std::chrono::milliseconds(1));
  sync.changed(std::make_shared<FileDescriptor>(kNoFile));
  while (sync.error() == 0) std::this_thread::yield();
  EXPECT_EQ(sync.error(), EBADF);
}

TEST(FileSync, AFileIsHeldNoLongerThanUntilItIsWrittenThrough) {
  const std::string path = testing::TempDir() + "/file_sync_test";
  auto file = std::make_shared<FileDescriptor>(::open(path.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0644));
  ASSERT_TRUE(file->valid());
  {
    FileSync sync(std::chrono::hours(1));
    for (int i = 0; i < 3; ++i) sync.changed(file);
    EXPECT_EQ(file.use_count(), 2);  // once, however often it changed
  }
  EXPECT_EQ(file.use_count(), 1);  // the end does not wait for the period
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace vantage
